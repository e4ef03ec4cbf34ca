"""Addresses of models: read, written, refused; and the user's yes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state import models
from vqa_state.errors import ModelError, NotApprovedError
from vqa_state.models.address import Device, ModelAddress, Precision, Source
from vqa_state.models.approval import approve, approved, is_approved, withdraw

parts = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1)


@given(
    st.sampled_from(Device),
    st.sampled_from(Precision),
    parts.filter(lambda text: text.strip() == text),
    st.sampled_from(["", "Look: {question}", "{question} #?&=%"]),
)
def test_what_is_written_is_read_again(device, precision, path, prompt):
    address = ModelAddress(Source.FOLDER, path, "", "", device, precision, prompt)
    assert ModelAddress.parse(str(address)) == address


@pytest.mark.parametrize(
    ("text", "where", "model", "revision"),
    [
        ("hub:Salesforce/blip-vqa-base", "Salesforce/blip-vqa-base", "", ""),
        ("hub:a/b@v1.0", "a/b", "", "v1.0"),
        ("folder:/models/my blip", "/models/my blip", "", ""),
        ("folder:C:\\models\\blip", "C:\\models\\blip", "", ""),
        ("server:http://[::1]:8000/v1#Qwen/Qwen3-VL", "http://[::1]:8000/v1", "Qwen/Qwen3-VL", ""),
    ],
)
def test_addresses_as_people_type_them(text, where, model, revision):
    address = ModelAddress.parse(f" {text} ")
    assert (address.where, address.model, address.revision) == (where, model, revision)
    assert ModelAddress.parse(str(address)) == address


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("blip", "hub:OWNER/NAME"),
        ("http://127.0.0.1:8000/v1", "server:http"),
        ("hub:blip", "looks like OWNER/NAME"),
        ("hub:../../etc", "looks like OWNER/NAME"),
        ("hub:a/b@../x", "no revision"),
        ("folder:", "name the model's folder"),
        ("server:http://x/v1", "say which model"),
        ("server:ftp://x/v1#m", "no address of a server"),
        ("server:http://user:key@x/v1#m", "without a user or a key"),
        ("server:http://x:99999/v1#m", "no address of a server"),
        ("folder:/m?precision=int4", "no precision; allowed"),
        ("folder:/m?speed=high", "no setting of a model"),
        ("folder:/m?prompt=hello", "{question} once"),
        ("folder:/m?prompt=%7Bquestion%7D" + "x" * 4000, "at most 4000"),
    ],
)
def test_an_address_that_cannot_be_used_says_why(text, says):
    with pytest.raises(ModelError) as caught:
        ModelAddress.parse(text)
    assert says in str(caught.value)


def test_a_model_that_only_a_file_names_is_not_used(data_home):
    name = "server:http://127.0.0.1:9/v1#some"
    with pytest.raises(NotApprovedError, match="models approve"):
        models.create(name)
    assert models.choose(name) == name
    assert models.create(name).name == name


def test_a_yes_is_for_the_model_whatever_its_settings(data_home):
    plain = ModelAddress.parse("folder:/m")
    approve(ModelAddress.parse("folder:/m?precision=bfloat16"))
    assert is_approved(plain)
    assert is_approved(ModelAddress.parse("folder:/m?prompt=%7Bquestion%7D"))
    assert not is_approved(ModelAddress.parse("folder:/n"))
    assert approved() == ["folder:/m"]
    withdraw(plain)
    assert not approved()
    with pytest.raises(ModelError, match="was not approved"):
        withdraw(plain)


@pytest.mark.parametrize("content", [b"", b"{", b"7", b'{"a": 1}', b'[1, "folder:/m"]'])
def test_a_damaged_list_of_yes_is_an_empty_one_or_what_is_left(data_home, content):
    data_home.mkdir(exist_ok=True)
    (data_home / "approved_models.json").write_bytes(content)
    assert approved() == (["folder:/m"] if b"folder" in content else [])


def test_choosing_a_registered_name_approves_nothing(data_home):
    assert models.choose("embedded") == "embedded"
    assert not data_home.exists()
