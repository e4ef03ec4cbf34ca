"""The answer store: nothing lost, nothing overwritten, nothing half written."""

import sqlite3
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vqa_state.answers.answer import Answer
from vqa_state.answers.store import AnswerStore, CopyKey, copy_keys
from vqa_state.errors import StoreError
from vqa_state.images.augmentation import Augmentation, AugmentationKind

KEY = CopyKey("ab" * 32, "rgb-shift", 0.1, 0, 0)
OTHER_KEYS = [
    replace(KEY, pixel_hash="cd" * 32),
    replace(KEY, kind="gaussian-noise"),
    replace(KEY, amount=0.1000001),
    replace(KEY, seed=1),
    replace(KEY, number=1),
]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "answers.sqlite"


@pytest.fixture
def store(path):
    with AnswerStore(path) as opened:
        yield opened


def test_what_was_saved_is_read(store, path):
    said = {"Open?": Answer("Yes.", 0.75), "Closed?": Answer("nö\x00 \n"), "": Answer("")}
    store.save("m/1", [(KEY, text, answer) for text, answer in said.items()])
    assert store.answers("m/1", KEY, list(said)) == said
    assert store.answers("m/1", KEY, ["Open?", "Never asked?"]) == {"Open?": said["Open?"]}
    store.close()
    with AnswerStore(path) as again:
        assert again.answers("m/1", KEY, list(said)) == said
        assert len(again) == 3


@settings(max_examples=30)
@given(
    st.dictionaries(
        st.text(),
        st.builds(Answer, st.text(), st.none() | st.floats(0, 1), st.booleans()),
        max_size=5,
    ),
    st.floats(0.0001, 1.0),
)
def test_any_text_and_number_comes_back(tmp_path_factory, said, amount):
    key = replace(KEY, amount=amount)
    questions = [text.encode("utf-8", "replace").decode() for text in said]
    with AnswerStore(tmp_path_factory.mktemp("store") / "a.sqlite") as store:
        expected = dict(zip(questions, said.values(), strict=True))
        store.save("m", [(key, text, answer) for text, answer in expected.items()])
        assert store.answers("m", key, questions) == expected


def test_an_answer_is_never_overwritten(store):
    store.save("m", [(KEY, "Open?", Answer("yes", 0.9))])
    store.save("m", [(KEY, "Open?", Answer("no", 0.1)), (KEY, "Closed?", Answer("no"))])
    assert store.answers("m", KEY, ["Open?"]) == {"Open?": Answer("yes", 0.9)}
    assert len(store) == 2


@pytest.mark.parametrize("other", OTHER_KEYS)
def test_another_copy_has_other_answers(store, other):
    store.save("m", [(KEY, "Open?", Answer("yes"))])
    assert store.answers("m", other, ["Open?"]) == {}
    store.save("m", [(other, "Open?", Answer("no"))])
    assert store.answers("m", KEY, ["Open?"]) == {"Open?": Answer("yes")}
    assert store.answers("m", other, ["Open?"]) == {"Open?": Answer("no")}


def test_another_fingerprint_never_meets_an_answer(store):
    store.save("m/1", [(KEY, "Open?", Answer("yes"))])
    for fingerprint in ("m/2", "m", "M/1", "m/1 ", ""):
        assert store.answers(fingerprint, KEY, ["Open?"]) == {}


def test_questions_differ_by_every_letter(store):
    store.save("m", [(KEY, "Open?", Answer("yes"))])
    assert store.answers("m", KEY, ["open?", "Open", "Open? "]) == {}


def test_keys_of_all_copies():
    keys = copy_keys("ab" * 32, Augmentation(AugmentationKind.GAUSSIAN_NOISE, 0.2, 3), 9)
    assert keys == [CopyKey("ab" * 32, "gaussian-noise", 0.2, 9, n) for n in range(3)]


def test_all_or_none(store):
    def breaks_off():
        yield KEY, "Open?", Answer("yes")
        raise RuntimeError("the model fell over")

    with pytest.raises(RuntimeError):
        store.save("m", breaks_off())
    no_text = SimpleNamespace(text=object(), p_yes=None, at_limit=False)
    with pytest.raises(sqlite3.Error):
        store.save("m", [(KEY, "Open?", Answer("yes")), (KEY, "Closed?", no_text)])
    assert len(store) == 0
    assert store._db.execute("SELECT count(*) FROM question").fetchone() == (0,)
    store.save("m", [(KEY, "Open?", Answer("yes"))])
    assert len(store) == 1


def test_a_full_disk_keeps_what_was_stored(store, path):
    store.save("m", [(KEY, "Open?", Answer("yes"))])
    pages = store._db.execute("PRAGMA page_count").fetchone()[0]
    store._db.execute(f"PRAGMA max_page_count = {pages + 2}")
    many = [(KEY, f"Question {n}?", Answer("no" * 500)) for n in range(200)]
    with pytest.raises(
        StoreError, match=r"answers\.sqlite .*nothing that was stored is lost: check"
    ):
        store.save("m", many)
    assert len(store) == 1
    store._db.execute("PRAGMA max_page_count = 100000")
    store.save("m", many)
    assert len(store) == 201
    with AnswerStore(path) as again:
        assert again.answers("m", KEY, ["Open?"]) == {"Open?": Answer("yes")}


def test_a_newer_store_is_refused(path):
    AnswerStore(path).close()
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 3")
    db.close()
    with pytest.raises(StoreError, match=r"newer version .* version 3, .* up to 2\); update"):
        AnswerStore(path)


@pytest.mark.parametrize(
    "content", [b"no database at all, but a longer text" * 50, b"SQLite format 3\0"]
)
def test_a_file_that_is_no_store_is_refused(path, content):
    path.write_bytes(content.ljust(100, b"x"))
    with pytest.raises(StoreError, match=r"answers\.sqlite is not an answer store .* backup"):
        AnswerStore(path)
    assert path.read_bytes().startswith(content)


def test_an_empty_file_becomes_a_store(path):
    path.touch()
    with AnswerStore(path) as store:
        assert len(store) == 0


def test_a_place_without_a_folder_is_refused(tmp_path):
    with pytest.raises(StoreError, match="cannot be read or written"):
        AnswerStore(tmp_path / "none" / "answers.sqlite")
    with pytest.raises(StoreError, match="cannot be read or written"):
        AnswerStore(tmp_path)


FILLED = [(KEY, f"Question {n}?", Answer(f"no {n}", 0.5)) for n in range(200)]


@settings(max_examples=60)
@given(changes=st.lists(st.tuples(st.integers(0, 2**17), st.integers(0, 255)), min_size=1))
def test_a_damaged_store_gives_a_sentence_or_answers(tmp_path_factory, changes):
    path = tmp_path_factory.mktemp("store") / "answers.sqlite"
    with AnswerStore(path) as store:
        store.save("m", FILLED)
    data = bytearray(path.read_bytes())
    for place, value in changes:
        data[place % len(data)] = value
    path.write_bytes(data)
    try:
        with AnswerStore(path) as store:
            answers = store.answers("m", KEY, [text for _, text, _ in FILLED])
            store.save("m", [(KEY, "One more?", Answer("yes"))])
    except StoreError:
        return
    assert all(isinstance(answer, Answer) for answer in answers.values())


def test_a_row_with_a_wrong_number_is_damage(store):
    store.save("m", [(KEY, "Open?", Answer("yes", 0.5))])
    store._db.execute("UPDATE answer SET p_yes = 7")
    with pytest.raises(StoreError, match=r"damaged .*p_yes must be in"):
        store.answers("m", KEY, ["Open?"])


def test_two_connections_at_once(path):
    with AnswerStore(path) as one, AnswerStore(path) as two:
        one.save("m", [(KEY, "Open?", Answer("yes"))])
        two.save("m", [(KEY, "Open?", Answer("no")), (KEY, "Closed?", Answer("no"))])
        assert one.answers("m", KEY, ["Open?", "Closed?"]) == {
            "Open?": Answer("yes"),
            "Closed?": Answer("no"),
        }
        assert len(one) == len(two) == 2


def test_many_connections_at_once(path):
    """Also the first opening, when all of them try to make the tables."""
    start = threading.Barrier(6)

    def work(number):
        start.wait()
        with AnswerStore(path) as store:
            for turn in range(15):
                store.save("m", [(replace(KEY, number=turn), f"{number}?", Answer("yes"))])

    with ThreadPoolExecutor(6) as pool:
        list(pool.map(work, range(6)))
    with AnswerStore(path) as store:
        assert len(store) == 90
