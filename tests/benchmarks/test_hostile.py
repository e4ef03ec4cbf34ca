"""Twenty seconds of hostile pictures; ten minutes of them are `python -m benchmarks.hostile`."""

import json
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SECONDS = float(os.environ.get("HOSTILE_SECONDS", "20"))


@pytest.fixture
def hostile(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    from benchmarks import hostile

    return hostile


@pytest.mark.filterwarnings("ignore")
def test_no_hostile_picture_breaks_a_bound(hostile, tmp_path, capsys):
    path = tmp_path / "rows.json"
    status = hostile.main(["--seconds", str(SECONDS), "--json", str(path)])
    rows = json.loads(path.read_text("utf-8"))
    assert not [row for row in rows if not row["holds"]], capsys.readouterr().err
    assert status == 0
    assert set(rows[0]) == {"what", "value", "unit", "bound", "holds"}
    assert any(row["what"].startswith("peak") for row in rows)


def test_a_broken_bound_is_a_failure(hostile, monkeypatch, capsys):
    monkeypatch.setattr(hostile, "measure_peak", lambda name: 800e6)
    assert hostile.main(["--seconds", "0.01"]) == 1
    assert "BROKEN" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("reading", "fault"),
    [
        ("crash", "crashes"),
        ("refuse", "sound pictures refused"),
        ("wrong", "wrong pixels"),
    ],
)
def test_a_fault_of_reading_is_counted(hostile, monkeypatch, reading, fault):
    def read(data):
        if reading == "crash":
            raise ZeroDivisionError
        if reading == "refuse":
            raise hostile.ImageError("no")
        return Wrong

    monkeypatch.setattr(hostile, "read_picture", read)
    rows = {row.what: row for row in hostile.measure(0.3, peaks=())}
    assert not rows[f"odd EXIF: {fault}"].holds
    assert rows["odd EXIF: files tried"].holds


class Wrong:
    """A picture that is another one."""

    from PIL import Image

    pixels = Image.new("RGB", (1000, 1))
