"""What the commands say of a model before it is asked, as a user runs them."""

import json
from dataclasses import replace

import pytest
import torch
from pictures import picture
from stub_server import Result, Stub, completion

from vqa_state import models
from vqa_state.answers.answer import Answer
from vqa_state.models import presets
from vqa_state.models.capability_cache import known_model
from vqa_state.models.vision_check import N_CALLS, Sight
from vqa_state.project.project import Project
from vqa_state.testing.fake_model import ScriptedModel

BLIND = "may drop the image"


@pytest.fixture(autouse=True)
def _own_home(data_home):
    """Nothing is known of any model, and none is approved."""


@pytest.fixture
def blind(registry):
    """A registered model that says yes to everything, slowly, as its note tells."""
    model = ScriptedModel(lambda image, question: Answer("yes"), name="blind", fingerprint="b/1")
    model.notes = ("It goes the slow way.",)
    models.register("blind", lambda: model)
    return model


@pytest.fixture
def folder(run, tmp_path):
    """A project with 16 photos, that was never asked."""
    for number in range(16):
        place = tmp_path / "photos" / ("open" if number % 2 else "closed")
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{number}.png").write_bytes(picture(number))
    assert run("new", tmp_path / "project", "--name", "door")[0] == 0
    assert run("add", tmp_path / "project", tmp_path / "photos")[0] == 0
    return tmp_path / "project"


def test_a_run_on_a_new_model_looks_first_warns_and_goes_on(run, folder, blind):
    code, out, err = run("ask", folder, "--model", "blind", "--copies", 1)
    assert code == 0
    assert "256 of 256 answers asked" in out
    assert BLIND in err
    assert "It goes the slow way." in err
    assert known_model("b/1").sight is Sight.BLIND


def test_a_known_model_is_not_looked_at_again_but_told_again(run, folder, blind):
    run("ask", folder, "--model", "blind", "--copies", 1)
    blind.asked.clear()
    code, _, err = run("ask", folder, "--copies", 2)
    assert code == 0
    assert BLIND in err
    assert len(blind.asked) == 256
    blind.asked.clear()
    _, _, err = run("ask", folder)  # all is answered: nobody need be told or shown anything
    assert BLIND not in err
    assert not blind.asked


def test_tune_looks_too(run, folder, blind):
    project = Project.open(folder)
    project.augmentation = replace(project.augmentation, n_copies=1)
    project.search = replace(project.search, population=10, generations=2)
    project.save()
    *_, err = run("tune", folder, "--model", "blind", "--engine", "paper", "--json")
    assert BLIND in err
    assert "It goes the slow way." in err


def test_a_server_that_drops_the_image_is_told_before_the_run(run, folder):
    calls = iter(range(10**6))

    def numbered(call, handler):
        return Result(completion(f"Yes. ({next(calls)})"))

    with Stub(numbered) as stub:
        code, _, err = run("ask", folder, "--model", f"server:{stub.url}#m", "--copies", 1)
    assert code == 0
    assert BLIND in err
    assert "It runs on this machine" in err
    assert len(stub.calls) == N_CALLS + 256


# ---- the cost ------------------------------------------------------------------------------


def test_the_cost_tells_of_the_look_then_of_time_and_memory(run, folder, blind):
    _, out, _ = run("ask", folder, "--cost", "--model", "blind", "--copies", 1)
    assert "256 to ask" in out
    assert f"up to {N_CALLS} calls, once, to see if the model sees" in out
    assert "python -m vqa_state models check 'blind'" in out
    assert not blind.asked
    assert run("models", "check", "blind")[0] == 0
    _, out, _ = run("ask", folder, "--cost", "--model", "blind", "--copies", 1)
    assert "minutes, by the pace measured here" in out
    assert "MB of memory" in out
    assert "models check" not in out
    assert "once, to see" not in out
    _, out, _ = run("ask", folder, "--cost", "--model", "blind", "--copies", 1, "--json")
    record = json.loads(out)
    assert record["n_look"] == 0
    assert record["seconds"] >= 0
    assert record["megabytes"] > 0


# ---- what models there are -----------------------------------------------------------------


def test_a_preset_tells_what_it_needs(run, monkeypatch):
    with_both = presets.Preset(
        "hub:a/b", "A", 2000, "free", ("json", "no_such_package", "nor_this")
    )
    plain = presets.Preset("hub:a/c", "C", 20, "free", ("json",))
    monkeypatch.setattr("vqa_state.cli.choosing.PRESETS", (with_both, plain))
    _, out, _ = run("models", "list")
    first, second = [line for line in out.splitlines() if "hub:a/" in line]
    assert "wants a GPU" in first
    assert "not installed here: pip install no_such_package nor_this" in first
    assert "needs json, installed here" in second
    assert "GPU" not in second
    rows = json.loads(run("models", "list", "--json")[1])["presets"]
    assert [row["missing"] for row in rows] == [["no_such_package", "nor_this"], []]
    assert [row["wants_gpu"] for row in rows] == [True, False]


def test_the_models_of_a_server_are_listed_ready_to_use(run):
    def listing(call, handler):
        return Result({"object": "list", "data": [{"id": "b c"}, {"id": "tiny"}]})

    with Stub(listing) as stub:
        code, out, _ = run("models", "list", "--server", f"server:{stub.url}")
        assert code == 0
        assert out.split("\n")[:2] == [f"server:{stub.url}#b%20c", f"server:{stub.url}#tiny"]
        document = json.loads(run("models", "list", "--server", stub.url, "--json")[1])
    assert document["models"] == out.split()
    assert {call.path for call in stub.calls} == {"/v1/models"}
    code, _, err = run("models", "list", "--server", stub.url)
    assert code == 1
    assert "error" in err


def test_old_weights_are_told_and_converted_by_address(run, tmp_path):
    old = tmp_path / "old"
    old.mkdir()
    (old / "config.json").write_text('{"model_type": "ofa"}')
    torch.save({"encoder.embed_tokens.weight": torch.ones(3, 2)}, old / "pytorch_model.bin")
    code, _, err = run("models", "convert", f"folder:{old}")
    assert (code, "written:" in err) == (0, True)
    assert (old / "model.safetensors").is_file()
    assert run("models", "convert", tmp_path)[0] == 1


def test_a_preset_with_old_weights_says_how_to_convert_it(run, tmp_path, monkeypatch):
    old = tmp_path / "old"
    old.mkdir()
    (old / "config.json").write_text('{"model_type": "ofa"}')
    (old / "pytorch_model.bin").write_bytes(b"weights")
    one = replace(presets.PRESETS[-1], address=f"folder:{old}")
    monkeypatch.setattr("vqa_state.cli.choosing.PRESETS", (one,))
    _, out, _ = run("models", "list")
    assert f"to be converted once with: python -m vqa_state models convert folder:{old}" in out


def test_an_approved_model_is_usable_only_where_it_is(run, folder, tmp_path):
    nowhere, here, old = (tmp_path / name for name in ("nowhere", "here", "old"))
    for place, weights in ((here, "model.safetensors"), (old, "pytorch_model.bin")):
        place.mkdir()
        (place / "config.json").write_text('{"model_type": "blip"}')
        (place / weights).write_bytes(b"")
    assert run("ask", folder, "--model", f"folder:{nowhere}")[0] == 1
    for address in (f"folder:{here}", f"folder:{old}", "server:http://127.0.0.1:9/v1#m"):
        assert run("models", "approve", address)[0] == 0
    _, out, _ = run("models", "list")
    said = {line.split()[0]: line for line in out.splitlines() if "approved" in line}
    assert said[f"folder:{nowhere}"].endswith("approved, not on this disk")
    assert said[f"folder:{here}"].endswith("approved, usable now")
    assert "approved, on this disk, to be converted once" in said[f"folder:{old}"]
    assert "approved, on a server" in said["server:http://127.0.0.1:9/v1#m"]
    assert [line.split()[0] for line in out.splitlines() if line.endswith(" usable now")] == [
        "embedded",
        f"folder:{here}",
    ]
    document = json.loads(run("models", "list", "--json")[1])
    assert f"folder:{nowhere}" not in document["usable"]
    assert {"address": f"folder:{nowhere}", "standing": "absent"} in document["approved"]


def test_a_list_of_approved_models_that_holds_no_address_is_still_listed(run, data_home):
    data_home.mkdir()
    (data_home / "approved_models.json").write_text('["no address", "folder:"]')
    code, out, _ = run("models", "list")
    assert code == 0
    assert out.count("approved, not on this disk") == 2
