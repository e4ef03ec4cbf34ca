"""The tree of errors: one base, drawn as it is."""

import inspect
import re
import tomllib
from pathlib import Path

import pytest

from vqa_state import errors
from vqa_state.errors import MissingPackageError, UnknownModelError, VQAStateError

CLASSES = [thing for _, thing in inspect.getmembers(errors, inspect.isclass)]


def test_every_error_has_the_one_base():
    assert all(issubclass(error, VQAStateError) for error in CLASSES)
    assert not issubclass(VQAStateError, LookupError | ValueError | OSError)


def test_the_drawing_is_the_tree():
    drawn = {}
    above = []
    for line in errors.__doc__.splitlines():
        match = re.match(r"(\W*)(\w+Error)\b", line)
        if match and (not drawn or match[1]):
            depth = len(match[1]) // 4
            above[depth:] = [match[2]]
            drawn[match[2]] = above[depth - 1] if depth else "Exception"
    assert drawn == {error.__name__: error.__base__.__name__ for error in CLASSES}


@pytest.mark.parametrize("error", CLASSES)
def test_every_error_is_explained(error):
    assert error.__doc__
    assert error.__doc__ != error.__base__.__doc__


def test_the_known_names_are_sorted():
    assert str(UnknownModelError("x", ["b", "a"])) == (
        "unknown model 'x'; choose one of: a, b, or give an address: hub:OWNER/NAME, "
        "folder:/path/to/model, server:http://host:port/v1#MODEL"
    )


def test_every_extra_is_one_of_the_project():
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())
    assert set(errors.EXTRAS.values()) <= set(project["project"]["optional-dependencies"])


def test_a_missing_package_comes_with_its_command():
    message = str(MissingPackageError("embedded", "torch"))
    assert message.endswith("install it with: pip install torch")
    message = str(MissingPackageError("hub:a/b", "transformers"))
    assert message.endswith("install it with: pip install 'vqa-state[local]'")
