"""The wheel holds all that the program needs, and works in an environment of its own."""

import os
import re
import signal
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import httpx
import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from vqa_state.project.project import Project
from vqa_state.project.split import Split

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]


def git_files():
    """What a clone holds, without the samples; a new file that is not ignored is one, too."""
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "-z"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    names = [name for name in listed.stdout.split("\0") if name]
    return [name for name in names if not name.startswith("projects/") and (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built in a copy so that nothing is left in the clone."""
    home = tmp_path_factory.mktemp("wheel")
    for name in git_files():
        copy = home / "clone" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes((ROOT / name).read_bytes())
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check",
         "--no-deps", "--no-build-isolation", "--wheel-dir", home, home / "clone"],
        check=True,
    )  # fmt: skip
    (built,) = home.glob("*.whl")
    return built


def test_every_file_of_the_package_is_in_the_wheel(wheel):
    inside = set(zipfile.ZipFile(wheel).namelist())
    ours = {name for name in git_files() if name.startswith("vqa_state/")}
    assert ours <= inside
    assert {name.partition("/")[0] for name in inside} == {
        "vqa_state", f"vqa_state-{PROJECT['version']}.dist-info",
    }  # fmt: skip


def test_the_wheel_says_types_licences_extras_and_the_command(wheel):
    archive = zipfile.ZipFile(wheel)
    info = f"vqa_state-{PROJECT['version']}.dist-info"
    for licence in ("LICENSE", "NOTICE"):
        held = archive.read(f"{info}/licenses/{licence}")
        assert held == (ROOT / licence).read_bytes()
    assert "vqa_state/py.typed" in archive.namelist()
    metadata = archive.read(f"{info}/METADATA").decode()
    assert set(re.findall(r"^Provides-Extra: (\S+)", metadata, re.MULTILINE)) == set(EXTRAS)
    assert (
        "vqa-state = vqa_state.__main__:start" in archive.read(f"{info}/entry_points.txt").decode()
    )


def pins():
    """Names and versions of requirements.txt."""
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    wanted = [line.partition("==") for line in lines if line and not line.startswith("#")]
    return {name.lower(): version for name, _, version in wanted}


def test_the_tested_versions_are_all_and_lie_in_the_ranges():
    ranges = [*PROJECT["dependencies"], *EXTRAS["app"], *EXTRAS["search"], *EXTRAS["local"]]
    wanted = {one.name.lower(): one.specifier for one in map(Requirement, ranges)}
    assert set(wanted) == set(pins())
    outside = [name for name, version in pins().items() if Version(version) not in wanted[name]]
    assert not outside


@pytest.fixture(scope="module")
def commands(wheel, tmp_path_factory):
    """The folder of the commands of a new environment with the wheel; libraries are lent to it."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, symlinks=True)
    python = home / "bin" / "python"
    subprocess.run(
        [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check",
         "--python", python, "install", "--no-deps", wheel],
        check=True,
    )  # fmt: skip
    (site,) = home.glob("lib/python*/site-packages")
    (site / "lent.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return home / "bin"


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """An empty folder outside the clone, with photos of both states."""
    sample = Project.open(ROOT / "projects" / "refrigerator")
    images = sample.labelled(Split.TRAIN)
    for label in (1, -1):
        folder = tmp_path / "photos" / sample.states.of(label)
        folder.mkdir(parents=True)
        for image in [one for one in images if one.label == label][:4]:
            (folder / f"{image.id}.jpg").write_bytes(sample.read(image))
    (tmp_path / "photo.jpg").write_bytes(sample.read(images[0]))
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    return tmp_path


@pytest.mark.thorough
def test_the_wheel_alone_tunes_and_recognizes(commands, outside):
    def run(*words):
        done = subprocess.run([commands / words[0], *words[1:]], capture_output=True, text=True)
        assert done.returncode == 0, f"{words}: {done.stderr}"
        return done.stdout

    where = run("python", "-c", "import vqa_state; print(vqa_state.__file__)")
    assert Path(where).is_relative_to(commands.parent)
    run("vqa-state", "new", "fridge", "--name", "refrigerator")
    run("vqa-state", "add", "fridge", "photos/open", "photos/closed")
    run("vqa-state", "ask", "fridge", "--copies", "1")
    run("vqa-state", "optimize", "fridge", "--population", "20", "--generations", "2")
    run("vqa-state", "tune", "fridge")
    run("vqa-state", "export", "fridge", "fridge.json")
    assert "valid votes" in run("vqa-state", "recognize", "fridge.json", "photo.jpg")
    run("vqa-state", "report", "fridge", "--html", "report.html")
    assert "<html" in (outside / "report.html").read_text(encoding="utf-8")
    refused = subprocess.run(
        [commands / "vqa-state", "reproduce", "--out", "out"], capture_output=True, text=True
    )
    assert "not part of an installed package" in refused.stderr


@pytest.mark.thorough
def test_the_wheel_alone_opens_the_app(commands, outside):
    server = subprocess.Popen(
        [commands / "vqa-state", "app", "--port", "0", "--no-browser"],
        stdout=subprocess.PIPE, text=True, env=os.environ | {"VQA_STATE_HOME": str(outside)},
    )  # fmt: skip
    try:
        address = re.search(r"http://\S+", server.stdout.readline())[0]
        assert str(outside / "projects") in server.stdout.readline()
        assert "VQA State" in httpx.get(address, timeout=60).text
    finally:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=60)
