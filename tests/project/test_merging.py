"""Laws of merging: what either changed is there, in either order, and what cannot be is refused."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pictures import picture

from vqa_state.errors import ConflictError, ProjectError
from vqa_state.project import project as project_module
from vqa_state.project.merging import merge
from vqa_state.project.project import Project, StateNames
from vqa_state.project.schema import LabelledImage, checked_content
from vqa_state.project.split import Split
from vqa_state.questions.grid import Question, QuestionGrid, StatePhrase, Wording
from vqa_state.search.objectives import Objective

STATES = StateNames("open", "closed")
IDS = [f"{n:064x}" for n in range(6)]


def image(image_id, label=None, split=None, accepted=False, looks=None):
    """One whose picture looks like no other's, unless `looks` says so."""
    looks = looks or f"{int(image_id, 16) * 0x1111_1111_1111_1111:016x}"[-16:]
    return LabelledImage(
        image_id, image_id, looks, "png", f"{image_id[-1]}.png", label, split, accepted
    )


def content(images=(), **changed):
    """What a new project is saved as, with these images and changes."""
    return checked_content(vars(Project(Path("nowhere"), "door", STATES)) | changed, images)


labels = st.sampled_from([None, 1, -1])
splits = st.sampled_from([None, *Split])
some = settings(max_examples=60)


@st.composite
def one_image(draw, image_id):
    label, split = draw(labels), draw(splits)
    accepted = label is not None and split is not Split.TEST and draw(st.booleans())
    return image(image_id, label, split if label else None, accepted)


@st.composite
def versions(draw):
    """What was read, and two changes of it: each image kept, changed, removed or added."""
    three = ([], [], [])
    for image_id in IDS[:3]:
        choices = [None, draw(one_image(image_id)), draw(one_image(image_id))]
        for of in three:
            chosen = draw(st.sampled_from(choices))
            if chosen is not None:
                of.append(chosen)
    looks = draw(st.lists(st.integers(0, 3), min_size=3, max_size=3))
    looks = [looks[0], looks[0] + looks[1], looks[0] + looks[2]]
    words = [Wording(f"w{n}") for n in range(4)]
    grids = [
        QuestionGrid(tuple(draw(st.lists(st.sampled_from(words), unique=True)))) for _ in three
    ]
    return [
        content(images, test_looks=n, grid=grid)
        for images, n, grid in zip(three, looks, grids, strict=True)
    ]


def merged_or_none(*three):
    try:
        return merge(*three)
    except ConflictError:
        return None


def by_id(of):
    return {one.id: one for one in of.images}


def without_order(of):
    return by_id(of), set(of.grid.wordings), of.test_looks


@some
@given(versions())
def test_the_order_of_two_programs_does_not_matter(three):
    base, mine, theirs = three
    one, other = merged_or_none(base, mine, theirs), merged_or_none(base, theirs, mine)
    assert (one is None) == (other is None)
    if one is not None:
        assert without_order(one) == without_order(other)


@some
@given(versions())
def test_a_change_of_one_alone_is_taken_as_it_is(three):
    base, changed, _ = three
    assert without_order(merge(base, changed, base)) == without_order(changed)
    assert without_order(merge(base, base, changed)) == without_order(changed)
    assert without_order(merge(base, changed, changed))[:2] == without_order(changed)[:2]


@some
@given(versions())
def test_no_change_is_lost_and_no_rule_is_broken(three):
    """Whatever either changed is in the merged one, or the merging was refused."""
    base, mine, theirs = three
    merged = merged_or_none(*three)
    if merged is None:
        return
    before, now = by_id(base), by_id(merged)
    for change in (by_id(mine), by_id(theirs)):
        for image_id in IDS:
            was, is_, got = (of.get(image_id) for of in (before, change, now))
            if is_ == was:
                continue
            assert (got is None) == (is_ is None)
            if is_ is not None and (was is None or was.label != is_.label) and is_.label:
                assert got.label == is_.label
    for one in now.values():
        assert not (one.accepted and one.split is Split.TEST)
    for wording in {*mine.grid.wordings, *theirs.grid.wordings} - {*base.grid.wordings}:
        assert wording in merged.grid.wordings
    for wording in base.grid.wordings:
        kept = wording in mine.grid.wordings and wording in theirs.grid.wordings
        assert (wording in merged.grid.wordings) == kept
    assert merged.test_looks == mine.test_looks + theirs.test_looks - base.test_looks


@some
@given(st.sets(st.sampled_from(IDS)), labels, labels)
def test_independent_changes_are_both_applied(own, here, there):
    base = content([image(i) for i in IDS])
    mine = content([image(i, here if i in own else None) for i in IDS])
    theirs = content([image(i, None if i in own else there) for i in IDS], seed=7)
    merged = merge(base, mine, theirs)
    assert {i: one.label for i, one in by_id(merged).items()} == {
        i: here if i in own else there for i in IDS
    }
    assert merged.seed == 7


@pytest.mark.parametrize(
    ("mine", "theirs", "sentence"),
    [
        ({"label": 1}, {"label": -1}, r"label of 0\.png was set to closed by .* set to open here"),
        ({"label": 1}, None, r"0\.png was removed by another program and changed here"),
        (None, {"label": 1}, r"0\.png was changed by another program and removed here"),
        ({"split": Split.TEST}, {"split": Split.TRAIN}, r"side of 0\.png was set to train .* test"),
        (
            {"label": 1, "accepted": True},
            {"split": Split.TEST},
            r"0\.png became a test image .* suggested .* must not judge",
        ),
    ],
)
def test_two_ways_for_one_image_are_refused_by_name(mine, theirs, sentence):
    first = image(IDS[0])
    base = content([first])
    both = (
        content([] if change is None else [replace(first, **change)]) for change in (mine, theirs)
    )
    with pytest.raises(ConflictError, match=f"^not saved: .*{sentence}.*open it again, look"):
        merge(base, *both)


@pytest.mark.parametrize(
    ("here", "there", "sentence"),
    [
        ({"seed": 1}, {"seed": 2}, "the seed was set to 2 by another program and to 1 here"),
        ({"name": "a"}, {"name": "b"}, "project's name was set to 'b' .* 'a' here"),
        ({"chosen": Objective.S_MINUS}, {"chosen": Objective.S_PRIME_PLUS}, "chosen objective"),
        ({"search_seed": 1}, {"search_seed": 2}, "seed of the search"),
        ({"model": "a", "fingerprint": "a/1"}, {"fingerprint": "b/1"}, "the model was set"),
    ],
)  # fmt: skip
def test_two_ways_for_one_setting_are_refused_by_name(here, there, sentence):
    with pytest.raises(ConflictError, match=sentence):
        merge(content(), content(**here), content(**there))


def test_different_settings_go_together():
    merged = merge(content(), content(seed=1, chosen=Objective.S_MINUS), content(search_seed=2))
    assert (merged.seed, merged.chosen, merged.search_seed) == (1, Objective.S_MINUS, 2)


def test_a_persons_label_counts_more_than_an_accepted_one():
    base, person = content([image(IDS[0])]), content([image(IDS[0], 1)])
    vote = content([image(IDS[0], 1, Split.TRAIN, accepted=True)])
    for mine, theirs in ((person, vote), (vote, person)):
        one = by_id(merge(base, mine, theirs))[IDS[0]]
        assert (one.label, one.split, one.accepted) == (1, Split.TRAIN, False)


def test_a_label_that_is_taken_away_takes_its_side_along():
    base = content([image(IDS[0], 1)])
    merged = merge(base, content([image(IDS[0])]), content([image(IDS[0], 1, Split.TRAIN)]))
    assert by_id(merged)[IDS[0]].split is None


def test_look_alikes_go_to_the_side_that_was_saved_first():
    alike = "00000000000000ff"
    far = image(IDS[2], 1, Split.TEST)
    mine = content([image(IDS[0], 1, Split.TRAIN, looks=alike), far])
    theirs = content([image(IDS[1], 1, Split.TEST, looks=alike)])
    merged = by_id(merge(content(), mine, theirs))
    assert {merged[i].split for i in IDS[:2]} == {Split.TEST}
    assert merged[IDS[2]] == far


def test_look_alikes_that_one_program_divided_itself_stay():
    alike = "00000000000000ff"
    sides = (Split.TRAIN, Split.TEST)
    mine = content([image(i, 1, s, looks=alike) for i, s in zip(IDS, sides, strict=False)])
    theirs = content([image(IDS[2], 1, Split.TEST, looks=alike)])
    merged = by_id(merge(content(), mine, theirs))
    assert [merged[i].split for i in IDS[:2]] == list(sides)


def test_questions_of_both_are_there_unless_they_contradict():
    own = [Question(f"Is it {n}?", 1) for n in range(3)]
    base = content(grid=QuestionGrid(custom=(own[0],)))
    mine = content(grid=QuestionGrid(custom=(own[0], own[1]), switched_off=("Is it 0?",)))
    theirs = content(grid=QuestionGrid(custom=(own[2],)))
    merged = merge(base, mine, theirs).grid
    assert (set(merged.custom), merged.switched_off) == ({own[1], own[2]}, ("Is it 0?",))
    for name, thing in (("custom", Question), ("phrases", StatePhrase)):
        here, there = (content(grid=QuestionGrid(**{name: (thing("ajar", s),)})) for s in (1, -1))
        with pytest.raises(ConflictError, match="'yes' to 'ajar' was given another meaning"):
            merge(content(), here, there)


def test_too_many_questions_together_are_refused():
    base = content()
    here, there = (
        content(grid=QuestionGrid(custom=tuple(Question(f"Is {at}{n}?", 1) for n in range(600))))
        for at in "ab"
    )
    with pytest.raises(ConflictError, match=r"both programs together cannot be used: .* 1,200"):
        merge(base, here, there)


@pytest.fixture
def two(project):
    """The same project, opened by two programs."""
    return Project.open(project.folder), Project.open(project.folder)


def test_saving_keeps_what_the_other_saved_and_shows_it(two):
    one, other = two
    first, second, third, *_ = one.images
    one.set_labels([first], -1)
    one.remove([third])
    one.test_looks += 1
    other.set_labels([second], -1)
    added = other.add(picture(77), "new.png", 1).image
    other.test_looks += 2
    one.save()
    other.save()
    assert [other.images[i].label for i in (first, second, added.id)] == [-1, -1, 1]
    assert third not in other.images
    assert other.test_looks == 3
    assert Project.open(other.folder) == other
    one.name = "another"
    one.save()
    assert one.images == other.images


def test_after_a_refusal_nothing_of_either_is_lost(two):
    one, other = two
    first = next(iter(one.images))
    one.set_labels([first], -1)
    one.save()
    other.set_labels([first], None)
    other.seed = 5
    before = (one.folder / "project.json").read_bytes()
    with pytest.raises(
        ConflictError, match=r"label of 0\.png was set to closed .* taken away here"
    ):
        other.save()
    assert (one.folder / "project.json").read_bytes() == before
    assert (other.images[first].label, other.seed) == (None, 5)
    other.set_labels([first], -1)
    other.save()
    assert Project.open(one.folder).seed == 5


def test_the_limit_of_images_holds_for_both_together(two, monkeypatch):
    one, other = two
    monkeypatch.setattr(project_module, "MAX_IMAGES", 7)
    one.add(picture(71), "a.png")
    other.add(picture(72), "b.png")
    one.save()
    with pytest.raises(ProjectError, match="both together have more than 7 images"):
        other.save()
    assert len(Project.open(one.folder).images) == 7
