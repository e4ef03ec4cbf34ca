"""No error repeats an address that may hold a password, however it was mistyped."""

import traceback

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state import models
from vqa_state.errors import ModelError
from vqa_state.models.address import ModelAddress, Source

SECRETS = [
    "https://user:{}@h/v1#m",
    "https://user:{}@h/v1",
    "https://user:{}%40h/v1#m",
    "https:/user:{}@h/v1#m",
    "https://{}@h/v1#m",
    "https://user:1234/{}@h/v1#m",
    "https://user:{}/x@h/v1#m",
    "https://user:{}#x@h/v1#m",
    "https://user:{}?x@h/v1#m",
    "https://user:1234?{}@h/v1#m",
    "https://user:1234?{}@h/v1",
    "https://user:1234?{}=x@h/v1#m",
    "https://user:{}\\@h/v1#m",
    "https://h/v1?api_key={}",
    "https://h/v1?api_key={}#m",
    "user:{}@h/v1#m",
    "ftp://user:{}@h/v1#m",
]


def told(make) -> str:
    """All that an error shows, its causes included, without the lines of this file."""
    with pytest.raises(ModelError) as caught:
        make()
    error, shown = caught.value, []
    while error is not None:
        shown += [str(error), repr(error), *traceback.format_exception_only(error)]
        error = error.__cause__ or error.__context__
    return "".join(shown)


@pytest.mark.parametrize("form", SECRETS)
@pytest.mark.parametrize("kind", ["", "server:", "hub:", "folder:", "Server:", " server:"])
def test_no_error_repeats_a_password(form, kind, data_home):
    text = kind + form.format("S3cret")
    if kind == "folder:" and "://" not in form:
        return  # a folder may be called so
    assert "S3cret" not in told(lambda: ModelAddress.parse(text))
    assert "S3cret" not in told(lambda: models.choose(text))
    assert "S3cret" not in told(lambda: models.create(text))
    assert not data_home.exists()


@given(st.text("aB1:/@#?=&%\\.", max_size=12), st.sampled_from(["", "server:", "hub:"]))
def test_whatever_stands_around_a_password_it_is_not_repeated(around, kind):
    text = f"{kind}https://user:S3cret{around}@h/v1#m"
    assert "S3cret" not in told(lambda: ModelAddress.parse(text))


def test_a_harmless_slip_is_still_repeated():
    for text in ("blip", "http://127.0.0.1:8000/v1", "hub:blip", "hub:a/b@../x"):
        what = text.partition(":")[2].rpartition("@")[2] if text.startswith("hub:") else text
        assert repr(what) in told(lambda text=text: ModelAddress.parse(text))


@pytest.mark.parametrize(
    ("query", "says"),
    [("precision", "no precision"), ("nonsense", "no setting"), ("device=cpu&x", "no setting")],
)
def test_a_setting_without_a_value_is_not_dropped(query, says):
    assert says in told(lambda: ModelAddress.parse(f"hub:a/b?{query}"))


@pytest.mark.parametrize(
    "where", ["http://h/v1", "https://h:8000/v1/x", "http://[::1]:8000", "http://a-b.c_d/v1"]
)
def test_a_plain_url_is_used_as_before(where):
    address = ModelAddress.parse(f"server:{where}#@cf/model")
    assert (address.source, address.where, address.model) == (Source.SERVER, where, "@cf/model")
    assert ModelAddress.parse(str(address)) == address
