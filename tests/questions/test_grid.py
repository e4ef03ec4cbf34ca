"""The grid of questions: the paper's sentences, their number, and what is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.errors import QuestionError
from vqa_state.questions.grid import (
    MAX_QUESTIONS,
    Article,
    Form,
    Question,
    QuestionGrid,
    StatePhrase,
    Wording,
    phrases_for,
)

OPEN_CLOSED = phrases_for("open", "closed")


def sentences(*wordings, phrases=OPEN_CLOSED, **axes):
    grid = QuestionGrid(tuple(Wording.parse(w) for w in wordings), phrases, **axes)
    return [question.text for question in grid.build().questions]


def test_the_papers_sentences():
    assert sentences("door", forms=(Form.IS,)) == [
        "Is a door open?",
        "Is the door open?",
        "Is this door open?",
        "Is that door open?",
        "Is a door closed?",
        "Is the door closed?",
        "Is this door closed?",
        "Is that door closed?",
    ]
    assert sentences("elevator door", forms=(Form.DOES,), articles=(Article.A, Article.THIS)) == [
        "Does this image look like an elevator door is open?",
        "Does this image look like this elevator door is open?",
        "Does this image look like an elevator door is closed?",
        "Does this image look like this elevator door is closed?",
    ]


def test_the_article_stands_in_the_tail():
    texts = sentences(
        "water | in {article} sink", "water | from {article} faucet", phrases=phrases_for("running")
    )
    assert "Is water running from this faucet?" in texts
    assert "Does this image look like water is not running in a sink?" in texts
    assert len(texts) == 32
    assert sentences("water | in {article} old sink", articles=(Article.A,))[0] == (
        "Is water open in an old sink?"
    )


EXPERIMENTS = {
    "door": (["door"], 16),
    "elevator": (["door", "elevator door"], 32),
    "cabinet": (["door", "cabinet door", "kitchen cabinet door", "shelf door"], 64),
    "refrigerator": (["refrigerator", "refrigerator door"], 32),
    "various doors": (["door"], 16),
    "microwave": (["door", "microwave door", "oven door", "microwave oven door"], 64),
    "transparent door": (["door", "transparent door", "glass door", "window"], 64),
    "light": (["light", "electricity"], 32),
    "display": (["display", "monitor", "computer monitor", "TV"], 64),
    "handbag": (["bag", "handbag"], 32),
    "water": (["water | in {article} sink", "water | from {article} faucet"], 32),
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_papers_experiments_have_its_numbers_of_questions(name):
    wordings, number = EXPERIMENTS[name]
    assert len(sentences(*wordings)) == number


ARTICLES = """
a: door, university, unicorn, uniform, unit, unique thing, user, used car, usb port, utensil
a: USB port, TV, european plug, one-way door, once, ukulele, u-turn, RAM, LAN cable, ewe, 4K screen
a: house, honeycomb, hair dryer, yellow door, UPS, utility room, utopia, urinal
a: unidirectional valve
an: elevator door, oven, hour, hourglass, honest man, heir, umbrella, unusual door, unlit lamp
an: LED, LCD display, HVAC unit, HDMI cable, MRI, SD card, x-ray, XL bag, L-shaped sofa, S-Bahn
an: 8-inch display, 8K TV, 11th door, 18-wheeler, urn, usher, open door, unidentified thing
an: uninhabited house, ultrasound, old door, ATM, apple, e-bike
"""


@pytest.mark.parametrize(
    ("article", "noun"),
    [
        (line.partition(": ")[0], noun)
        for line in ARTICLES.strip().splitlines()
        for noun in line.partition(": ")[2].split(", ")
    ],
)
def test_a_or_an_goes_by_the_sound(article, noun):
    text = sentences(noun, articles=(Article.A,), forms=(Form.IS,))[0]
    assert text == f"Is {article} {noun} open?"


def test_without_an_antonym_not_is_one():
    assert phrases_for("running") == (StatePhrase("running", 1), StatePhrase("not running", -1))
    assert phrases_for("on", "off") == (StatePhrase("on", 1), StatePhrase("off", -1))


def test_a_second_question_with_the_same_text_is_dropped_and_listed():
    own = Question("Is the door open?", -1)
    built = QuestionGrid((Wording("door"), Wording(" door ")), OPEN_CLOSED, custom=(own,)).build()
    assert len(built.questions) == 16
    assert len(built.duplicates) == 17
    assert built.duplicates[-1] == own
    kept = next(q for q in built.questions if q.text == own.text)
    assert kept.yes_means == 1


def test_questions_can_be_switched_off_and_added():
    own = Question("Can a cat walk through?", 1)
    grid = QuestionGrid(
        (Wording("door"),), OPEN_CLOSED, custom=(own,), switched_off=("Is a door open?", "gone?")
    )
    built = grid.build()
    assert len(built.questions) == 16
    assert built.questions[-1] == own
    assert [q.text for q in built.switched_off] == ["Is a door open?"]
    assert own.form is Form.CUSTOM


def test_the_order_of_switching_off_does_not_make_another_grid():
    assert QuestionGrid(switched_off=("b", "a", "b")) == QuestionGrid(switched_off=("a", "b"))


def test_a_question_knows_its_place_on_the_axes():
    grid = QuestionGrid((Wording("water", "in {article} sink"),), phrases_for("running"))
    question = grid.build().questions[-1]
    assert question.text == "Does this image look like water is not running in that sink?"
    assert (question.form, question.article) == (Form.DOES, Article.THAT)
    assert (question.phrase, question.yes_means) == ("not running", -1)
    assert question.wording == "water in {article} sink"


def test_a_grid_beyond_the_limit_is_refused():
    wordings = tuple(Wording(f"door {number}") for number in range(313))
    with pytest.raises(QuestionError, match=r"5,008 questions; at most 1,000 .* take out"):
        QuestionGrid(wordings, OPEN_CLOSED)
    own = tuple(Question(f"Is door {n} open?", 1) for n in range(MAX_QUESTIONS))
    assert len(QuestionGrid(custom=own).build().questions) == MAX_QUESTIONS
    with pytest.raises(QuestionError, match="1,001 questions"):
        QuestionGrid(custom=(*own, Question("One more?", 1)))


@pytest.mark.parametrize("noun", ["", " ", "\n\t", "\u2003"])
def test_an_empty_wording_is_refused(noun):
    with pytest.raises(QuestionError, match="a wording is empty; type at least one word"):
        Wording(noun)


@pytest.mark.parametrize("text", ["do\x00or", "do\x1bor", "\x7fdoor", "door\ud800"])
def test_control_characters_are_refused(text):
    for make in (Wording, lambda t: Question(t, 1), lambda t: StatePhrase(t, 1)):
        with pytest.raises(QuestionError, match="control characters"):
            make(text)


def test_too_long_texts_are_refused_where_they_are_typed():
    with pytest.raises(QuestionError, match="a wording has 81 characters; at most 80"):
        Wording("d" * 81)
    with pytest.raises(QuestionError, match="a question has 301 characters; at most 300"):
        Question("d" * 301, 1)
    tail = "in {article} " + "s" * 67
    grid = QuestionGrid((Wording("w" * 80, tail),), (StatePhrase("p" * 80, 1),))
    assert len(grid.build().questions) == 8


@pytest.mark.parametrize(
    "tail",
    [
        *("", " ", "in the sink", "in {article}", "in {article} {article} sink"),
        *("{article}sink", "in{article} sink", "in {Article} sink", "in {} sink"),
    ],
)
def test_a_tail_without_a_place_for_one_article_is_refused(tail):
    with pytest.raises(QuestionError, match=r"\{article\}|tail is empty"):
        Wording("water", tail)


@pytest.mark.parametrize("noun", ["wa|ter", "water {article}"])
def test_a_noun_that_looks_like_a_tail_is_refused(noun):
    with pytest.raises(QuestionError, match="must be a plain noun"):
        Wording(noun)


@pytest.mark.parametrize("line", ["door", "elevator door", "water | in {article} sink"])
def test_a_wording_reads_what_it_writes(line):
    assert str(Wording.parse(line)) == line
    assert Wording.parse(f"  {line.replace(' ', '  ')} ") == Wording.parse(line)


@pytest.mark.parametrize("yes_means", [0, 2, -2, None, "1"])
def test_yes_means_one_of_two_states(yes_means):
    with pytest.raises(QuestionError, match=r"positive \(\+1\) or the negative state \(-1\)"):
        Question("Is the door open?", yes_means)


def test_custom_is_no_form_of_a_grid():
    with pytest.raises(QuestionError, match="own questions go beside it"):
        QuestionGrid((Wording("door"),), OPEN_CLOSED, forms=(Form.CUSTOM,))


nouns = st.text(alphabet="abcdefghijklmnopqrstuvwxyzAEIOUéß8-'? ", min_size=1, max_size=30).filter(
    lambda text: text.strip()
)
tails = st.none() | nouns.map("in {{article}} {}".format)
wording = st.builds(Wording, nouns, tails)
phrases = st.builds(StatePhrase, nouns, st.sampled_from([1, -1]))
grids = st.builds(
    QuestionGrid,
    st.lists(wording, max_size=4).map(tuple),
    st.lists(phrases, max_size=3).map(tuple),
    st.sets(st.sampled_from([Form.IS, Form.DOES])).map(tuple),
    st.sets(st.sampled_from(Article)).map(tuple),
)


@given(grids)
def test_every_cell_is_one_question_or_a_named_duplicate(grid):
    built = grid.build()
    n_cells = len(grid.wordings) * len(grid.phrases) * len(grid.forms) * len(grid.articles)
    assert len(built.questions) + len(built.duplicates) == n_cells
    texts = [question.text for question in built.questions]
    assert len(set(texts)) == len(texts)
    assert {question.text for question in built.duplicates} <= set(texts)


@given(grids)
def test_polarity_is_that_of_the_phrase(grid):
    meanings = {(phrase.text, phrase.yes_means) for phrase in grid.phrases}
    for question in grid.build().questions:
        assert (question.phrase, question.yes_means) in meanings
        assert question.text.endswith("?")
        assert "{" not in question.text
        assert "  " not in question.text


@given(grids, st.data())
def test_switching_off_takes_away_just_those(grid, data):
    every = [question.text for question in grid.build().questions]
    off = data.draw(st.sets(st.sampled_from(every))) if every else set()
    smaller = QuestionGrid(
        grid.wordings, grid.phrases, grid.forms, grid.articles, switched_off=tuple(off)
    ).build()
    assert [q.text for q in smaller.questions] == [t for t in every if t not in off]
    assert {q.text for q in smaller.switched_off} == off
