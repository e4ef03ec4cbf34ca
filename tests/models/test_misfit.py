"""Packages that are missing or do not fit: which one, and what to do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tiny_models import tiny_folder

from vqa_state import models
from vqa_state.errors import MissingPackageError, ModelError
from vqa_state.models.import_faults import import_fault, missing_package

ROOT = Path(__file__).parents[2]

ASK = """
import sys
from vqa_state import models
from vqa_state.errors import ModelError
try:
    models.create(models.choose(sys.argv[1]))
except ModelError as error:
    print(type(error).__name__, error)
else:
    print("loaded")
"""


def opened_beside(packages, folder):
    """What a process says that opens a model with other packages before the installed ones."""
    place = {"PYTHONPATH": f"{packages}:{ROOT}", "VQA_STATE_HOME": str(packages / "home")}
    done = subprocess.run(
        [sys.executable, "-c", ASK, f"folder:{folder}"],
        env=os.environ | place,
        capture_output=True,
        text=True,
        check=True,
        timeout=200,
    )
    return done.stdout.strip()


def fake_torchvision(home, code):
    package = home / "torchvision"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(code)
    for part in ("transforms", "io", "ops"):
        (package / f"{part}.py").write_text("")
    info = home / "torchvision-0.9.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: torchvision\nVersion: 0.9.0\n")
    (info / "RECORD").write_text("torchvision/__init__.py,,\n")
    return home


@pytest.mark.parametrize(
    ("family", "code"),
    [
        ("blip", "raise RuntimeError('operator torchvision::nms does not exist')"),
        ("vilt", "raise ImportError('libcudart.so.99: cannot open shared object file')"),
        ("idefics3", "raise AttributeError('no attribute extension')"),
    ],
)
def test_a_torchvision_that_does_not_fit_is_named(tmp_path, family, code):
    said = opened_beside(fake_torchvision(tmp_path, code), tiny_folder(family))
    torch_minor = int(__import__("torch").__version__.split(".")[1])
    assert said.startswith("ModelError the model '")
    assert "the installed torchvision does not fit torch" in said
    assert code.split("'")[1] in said
    assert f'pip install "torchvision==0.{torch_minor + 15}.*"' in said
    assert "pip uninstall torchvision" in said


def raised(build):
    try:
        build()
    except ImportError as error:
        return error
    raise AssertionError("nothing was raised")


def missing():
    import surely_not_installed

    return surely_not_installed


def wrapped():
    try:
        missing()
    except ImportError as error:
        raise ModuleNotFoundError("Could not import module 'AutoImageProcessor'.") from error


def damaged():
    raise ImportError("cannot import name 'x' from 'y' (/a/y.py)", name="y")


@pytest.mark.parametrize("build", [missing, wrapped])
def test_a_package_is_found_behind_what_a_library_made_of_it(build):
    fault = import_fault("mine", raised(build))
    assert isinstance(fault, MissingPackageError)
    assert "pip install surely_not_installed" in str(fault)


def test_another_failed_import_is_told_in_words():
    fault = import_fault("mine", raised(damaged))
    assert type(fault) is ModelError
    assert "cannot import name 'x' from 'y'" in str(fault)


def test_our_own_mistake_stays_one():
    def own():
        from vqa_state.answers.answer import no_such_thing

        return no_such_thing

    assert import_fault("mine", raised(own)) is None


def test_a_registered_model_tells_the_same(registry):
    models.register("needy", wrapped)
    with pytest.raises(MissingPackageError, match="surely_not_installed"):
        models.create("needy")


def test_the_package_that_fetches_native_code_is_never_recommended():
    assert missing_package("Please install it, e.g. `pip install kernels==0.12`") is None
    assert missing_package("requires the Torchvision library but") == "torchvision"
