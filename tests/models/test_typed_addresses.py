"""Addresses as people type them: odd folders, wrong names, another place to start from."""

import random

import pytest
from huggingface_hub.errors import HFValidationError
from huggingface_hub.utils import validate_repo_id
from hypothesis import given
from hypothesis import strategies as st
from tiny_models import tiny_folder

from vqa_state import models
from vqa_state.errors import ModelError, NotApprovedError
from vqa_state.models.address import Device, ModelAddress, Source
from vqa_state.models.approval import approve, approved, is_approved, withdraw
from vqa_state.models.opening import folder_of


def is_valid_for_the_hub(name):
    try:
        validate_repo_id(name)
    except HFValidationError:
        return False
    return name.count("/") == 1


def is_valid_for_us(name):
    try:
        ModelAddress(Source.HUB, name)
    except ModelError:
        return False
    return True


@pytest.mark.parametrize(
    "name", ["a--b/c", "a/b..c", "a/b.git", "a/b-", "a-/b", "a./b", "a/b.", "a.b.git/c.git", "ä/b"]
)
def test_a_name_that_the_hub_refuses_is_refused_in_words(name):
    assert not is_valid_for_the_hub(name)
    with pytest.raises(ModelError, match="no name of a hub model"):
        ModelAddress.parse(f"hub:{name}")


@given(st.text("ab.-_/gitG0é", min_size=1, max_size=12))
def test_what_we_take_the_hub_takes(name):
    assert not is_valid_for_us(name) or is_valid_for_the_hub(name)


def test_and_what_the_hub_takes_we_take():
    letters, choose = "aZ09._-", random.Random(0)
    for _ in range(3000):
        owner, name = ("".join(choose.choices(letters, k=choose.randint(1, 4))) for _ in "ab")
        # The hub's own rule would let an underscore begin a name; no account there has one.
        if not owner.startswith("_") and not name.startswith("_"):
            one = f"{owner}/{name}"
            assert is_valid_for_us(one) == is_valid_for_the_hub(one), one


@pytest.mark.parametrize("where", ["/m/C#/x", "/m/what?/x", "/m/a?b#c", "/m?", "#", "/m/a&b=c"])
def test_a_folder_is_not_cut(where):
    address = ModelAddress.parse(f"folder:{where}")
    assert (address.where, address.model) == (where, "")
    assert ModelAddress.parse(str(address)) == address


def test_settings_follow_such_a_folder():
    address = ModelAddress.parse("folder:/m/what?/C#?device=cpu&prompt=Is it so? {question}?")
    assert address.where == "/m/what?/C#"
    assert address.device is Device.CPU
    assert address.prompt == "Is it so? {question}?"


@pytest.mark.parametrize("where", ["~surely_no_such_user/x", "/" + "x" * 3000, "/m\0x"])
def test_a_folder_that_cannot_be_is_not_there(where):
    with pytest.raises(ModelError, match="there is no folder") as caught:
        folder_of(ModelAddress(Source.FOLDER, where))
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("text", ["folder:/m\ud800", "server:http://h/v1#\udcff", "hub:a/\udc80"])
def test_letters_that_cannot_be_written(text):
    with pytest.raises(ModelError) as caught:
        ModelAddress.parse(text)
    str(caught.value).encode()


def test_a_relative_folder_is_kept_as_the_place_that_it_was(data_home, monkeypatch, tmp_path):
    (tmp_path / "here").symlink_to(tiny_folder("blip"))
    monkeypatch.chdir(tmp_path)
    name = models.choose("folder:here?device=cpu")
    assert name == f"folder:{tmp_path / 'here'}?device=cpu"
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    assert models.create(name).name == name
    with pytest.raises(NotApprovedError):
        models.create("folder:here")


def test_a_yes_to_a_relative_folder_is_for_this_place_alone(data_home, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    address = ModelAddress.parse("folder:m")
    approve(address)
    assert approved() == [f"folder:{tmp_path / 'm'}"]
    assert is_approved(address)
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    assert not is_approved(address)
    monkeypatch.chdir(tmp_path)
    withdraw(address)
    assert approved() == []


def test_the_home_of_a_user_stays_as_it_was_typed(data_home):
    assert models.choose("folder:~/m") == "folder:~/m"
