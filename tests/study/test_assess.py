"""Honest numbers of a project: from training images alone, and true to what it exports."""

import json
import time
from threading import Event, Timer

import numpy as np
import pytest
from pydantic import ValidationError
from tuned_project import MODEL, tuned_copy

from vqa_state.errors import ModelError, NothingToSearchError
from vqa_state.evaluation.coverage import single_votes
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.recognizer.recognizer import read_recognizer
from vqa_state.recognizer.schema import CarefulRecord
from vqa_state.search.objectives import Objective
from vqa_state.study import assess as assessing
from vqa_state.study.assess import Stage, assess, assessment
from vqa_state.study.export import recognizer_with
from vqa_state.study.leaderboard import RIVAL, standings, standings_frame
from vqa_state.study.optimize import optimize, results
from vqa_state.study.suggest import accept, ask_unlabelled, hints
from vqa_state.votes.reject_option import AbstainRule
from vqa_state.votes.rules import VoteKind
from vqa_state.votes.state import State


class Colours:
    """A quick image network: mean and spread of each channel."""

    n_features = 6
    fingerprint = "colours/1"

    def __init__(self):
        self.n_seen = 0

    def __call__(self, images):
        for image in images:
            self.n_seen += 1
            pixels = np.asarray(image, np.float32).reshape(-1, 3)
            yield np.concatenate([pixels.mean(axis=0), pixels.std(axis=0)])


@pytest.fixture
def tuned(make_project, tmp_path):
    return tuned_copy(make_project, tmp_path)


def without_time(one):
    """An assessment as JSON; only the rival's milliseconds are measured anew."""
    rival = one.rival and one.rival.model_copy(update={"milliseconds": None})
    return one.model_copy(update={"rival": rival}).model_dump_json()


def assessed(project, **options):
    options = {"features": Colours, "n_resamples": 6} | options
    *_, last = assess(project, **options)
    return last.assessment


def test_it_is_kept_and_repeats(tuned):
    first = assessed(tuned)
    path = tuned.folder / "assessments" / "s_plus.json"
    assert assessment(tuned, results(tuned)).model_dump_json() == first.model_dump_json()
    assert without_time(assessed(tuned)) == without_time(first)
    assert path.exists()
    assert list(first.votes) == list(VoteKind)
    assert first.finished
    assert first.n_resamples == 6


def test_test_images_change_nothing_that_is_chosen(tuned):
    before = assessed(tuned)
    found = results(tuned)
    kinds = list(VoteKind)
    files = [recognizer_with(tuned, found, before, kind, 0.8) for kind in kinds]
    for image in tuned.labelled(Split.TEST):
        tuned.set_labels([image.id], -image.label)
    after = assessed(tuned)
    assert without_time(after) == without_time(before)
    tuned.set_splits([image.id for image in tuned.labelled(Split.TEST)], Split.UNUSED)
    alone, nothing_left = assessed(tuned), results(tuned)
    again = [recognizer_with(tuned, nothing_left, alone, kind, 0.8) for kind in kinds]
    for one, other in zip(files, again, strict=True):
        same = {"scores": one.scores.model_copy(update={"test": None})}
        assert one.model_copy(update=same).to_bytes() == other.to_bytes()


@pytest.mark.parametrize("change", ["label", "choice", "subset", "damage"])
def test_it_is_stale_after_a_change(tuned, change):
    assessed(tuned)
    path = tuned.folder / "assessments" / "s_plus.json"
    if change == "label":
        image = tuned.labelled(Split.TRAIN)[0]
        tuned.set_labels([image.id], -image.label)
        list(optimize(tuned, prove=False))
    elif change == "choice":
        tuned.chosen = Objective.S_MINUS
    elif change == "subset":
        content = json.loads(path.read_text())
        path.write_text(json.dumps(content | {"subset": [0]}))
    else:
        path.write_text("{")
    assert assessment(tuned, results(tuned)) is None


def test_a_stop_keeps_what_came(tuned):
    steps = iter([False, True])
    *_, last = assess(tuned, lambda: next(steps, True), features=Colours, n_resamples=6)
    kept = last.assessment
    assert (kept.finished, kept.n_resamples, kept.rival) == (False, 2, None)
    table = standings(tuned.chosen, results(tuned), kept)
    assert any("stopped after 2 resamples" in one for one in table.warnings)


def test_features_are_computed_once_and_damage_is_mended(tuned):
    colours = Colours()
    timed = 4  # pictures, whose time is measured anew
    first = assessed(tuned, features=lambda: colours)
    assert colours.n_seen == (14 + timed) * tuned.augmentation.n_copies
    second = assessed(tuned, features=lambda: colours)
    assert colours.n_seen == (14 + 2 * timed) * tuned.augmentation.n_copies
    assert without_time(second) == without_time(first)
    damaged = next((tuned.folder / "features").iterdir())
    damaged.write_bytes(damaged.read_bytes()[:-9])
    assert without_time(assessed(tuned, features=lambda: colours)) == without_time(first)
    assert colours.n_seen == (15 + 3 * timed) * tuned.augmentation.n_copies
    assert set(first.rival.sides) == {i.id for i in tuned.labelled(Split.TRAIN, Split.TEST)}


def test_the_rival_is_timed_and_estimated_like_a_vote(tuned):
    class Slow(Colours):
        def __call__(self, images):
            time.sleep(0.03)
            yield from super().__call__(images)

    kept = assessed(tuned, features=Slow)
    assert 30 <= kept.rival.milliseconds < 300
    assert 0 <= kept.rival.estimate.low <= kept.rival.estimate.share <= kept.rival.estimate.high
    (row,) = [r for r in standings(tuned.chosen, results(tuned), kept).rows if r.name == RIVAL]
    assert (row.milliseconds, row.estimate) == (kept.rival.milliseconds, kept.rival.estimate)


def test_a_stop_does_not_wait_for_the_network(tuned):
    """Loading torch takes seconds; a stop goes on without it."""
    released = Event()

    def slow():
        released.wait(30)
        return Colours()

    began, stopped = None, Event()
    for step in assess(tuned, stopped.is_set, features=slow, n_resamples=2):
        if step.stage is Stage.LOADING:
            began = time.monotonic()
            Timer(0.1, stopped.set).start()
    assert time.monotonic() - began < 10
    assert (step.assessment.rival, step.assessment.no_rival) == (None, "it was stopped")
    released.set()


def test_a_stop_in_any_stage_ends_it_at_once_and_keeps_what_came(tuned):
    """After a stop there is at most one report more: the last, with what came."""
    stages = [step.stage for step in assess(tuned, features=Colours, n_resamples=3)]
    for number in (*(stages.index(stage) + 1 for stage in Stage), len(stages) - 1):
        n_seen, last = 0, None
        for last in assess(tuned, lambda: n_seen >= number, features=Colours, n_resamples=3):  # noqa: B007, B023
            n_seen += 1
        assert n_seen <= number + 1
        assert last.assessment is not None
        assert last.assessment.finished is False


def test_without_an_image_network_the_reason_is_told(tuned):
    def missing():
        raise ModelError("the weights are gone")

    kept = assessed(tuned, features=missing)
    assert (kept.rival, kept.no_rival) == (None, "the weights are gone")
    table = standings(tuned.chosen, results(tuned), kept)
    assert any("the weights are gone" in one for one in table.warnings)


def test_every_exported_kind_recognizes_what_the_table_says(tuned):
    kept, found = assessed(tuned), results(tuned)
    rows = {row.kind: row for row in standings(tuned.chosen, found, kept).rows[: len(VoteKind)]}
    for kind in VoteKind:
        recognizer = recognizer_with(tuned, found, kept, kind)
        assert read_recognizer(recognizer.to_bytes(), "it").to_bytes() == recognizer.to_bytes()
        right = {1: 0, -1: 0}
        for image in tuned.labelled(Split.TEST):
            verdict = recognizer.recognize(tuned.image_path(image), MODEL)
            early = recognizer.recognize(tuned.image_path(image), MODEL, stop_early=True)
            assert early.state is verdict.state
            right[image.label] += verdict.state is (
                State.POSITIVE if image.label > 0 else State.NEGATIVE
            )
        test = rows[kind].test
        assert (right[1], right[-1]) == (test.positive[0], test.negative[0])
        assert recognizer.scores.test.n_recognized == test.whole[0] == sum(right.values())
        assert recognizer.calls_per_image == rows[kind].n_calls >= rows[kind].early_calls
        assert recognizer.estimate.n_resamples == 6


def test_the_recommended_kind_is_shown_with_the_choice_inside(tuned):
    """Its own estimate flatters, because it was picked by it; all others keep their own."""
    from dataclasses import replace

    kept, found = assessed(tuned), results(tuned)
    honest = replace(kept.recommended_estimate, share=0.123, low=0.1, high=0.2)
    kept = kept.model_copy(update={"recommended_estimate": honest})
    table = standings(tuned.chosen, found, kept)
    for row in table.rows[: len(VoteKind)]:
        best = row.kind is kept.recommendation.kind
        assert row.recommended is best
        assert row.estimate == (honest if best else kept.estimates[row.kind])
        written = recognizer_with(tuned, found, kept, row.kind).estimate
        assert written.share == round(row.estimate.share, 6)
    assert "1.0 of 8" in table.recommendation
    assert any("keep only 1.0 of 8" in one for one in table.warnings)


def test_coverage_makes_the_recognizer_abstain(tuned):
    kept, found = assessed(tuned), results(tuned)
    curve = kept.curves[VoteKind.PAPER]
    cautious = recognizer_with(tuned, found, kept, VoteKind.PAPER, 0.3)
    assert cautious.abstain.coverage == 0.3
    assert cautious.abstain.min_sureness in {point.min_sureness for point in curve}
    assert cautious.abstain.min_sureness > 0
    (point,) = [one for one in curve if one.min_sureness == cautious.abstain.min_sureness]
    said = cautious.abstain.out_of_bag
    assert (said.n_images, said.n_votes) == (point.n_images, point.n_votes)
    assert (said.n_verdicts, said.n_right) == (point.n_covered, point.n_correct)
    assert f"{point.n_correct} of these are right" in said.sentence()
    assert read_recognizer(cautious.to_bytes(), "it").to_bytes() == cautious.to_bytes()
    plain = json.loads(recognizer_with(tuned, found, kept).to_bytes())
    assert "out_of_bag" not in plain["abstain"]  # as files had it before there was such a count
    with pytest.raises(ValueError, match="coverage must be"):
        recognizer_with(tuned, found, kept, VoteKind.PAPER, 1.5)


@pytest.mark.parametrize(
    "wrong", [{"n_right": 6}, {"n_verdicts": 11}, {"low": 0.95}, {"n_votes": 0}]
)
def test_a_file_cannot_count_impossible_verdicts(wrong):
    fields = {"n_images": 4, "n_votes": 10, "n_verdicts": 5, "n_right": 4, "low": 0.4, "high": 0.9}
    assert "4 of these are right (80%" in CarefulRecord(**fields).sentence()
    with pytest.raises(ValidationError):
        CarefulRecord(**(fields | wrong))


def test_each_single_vote_of_a_bag_counts_once(tuned, monkeypatch):
    """By the votes of the resamples, one image at a time, with the rule that recognizes."""
    seen = []
    monkeypatch.setattr(
        assessing, "single_votes", lambda *given: seen.append(given) or single_votes(*given)
    )
    kept = assessed(tuned)
    for out, kind, train in seen:
        n_votes = sum(int(one.out.sum()) for one in out.resamples)
        for point in kept.curves[kind]:
            n_covered = n_right = 0
            for resample in out.resamples:
                rule = AbstainRule(resample.votes[kind], point.min_sureness)
                for place in np.flatnonzero(resample.out):
                    shares = train.p_positive[[place]]
                    (state,) = rule.states(train.verdicts[[place]], shares)
                    n_covered += state != 0
                    n_right += state == train.labels[place]
            assert (point.n_votes, point.n_covered) == (n_votes, n_covered)
            assert point.n_correct == n_right
    assert {kind for _, kind, _ in seen} == set(VoteKind)


def test_other_votes_need_an_assessment(tuned):
    found = results(tuned)
    with pytest.raises(NothingToSearchError, match="assess"):
        recognizer_with(tuned, found, None, VoteKind.THRESHOLD)
    assert recognizer_with(tuned, found, None).vote is VoteKind.PAPER


def test_the_table_holds_all_that_a_user_could_take(tuned):
    table = standings(tuned.chosen, results(tuned), assessed(tuned))
    names = [row.name for row in table.rows]
    assert names[:4] == ["s+", "s+, threshold", "s+, weighted answers", "s+, weighted p_yes"]
    assert {"s'+", "s-", "s'-", "best question", RIVAL} <= set(names)
    assert len(table.comparisons) >= 3
    for one in table.comparisons:
        assert one.sentence() in table.sentences
    assert "that only shows" in table.sentences[0]
    assert sum(row.recommended for row in table.rows) == 1
    assert "★" in " ".join(map(str, standings_frame(table)["recognizer"]))
    for row in table.rows:
        assert row.test.positive[0] + row.test.negative[0] == row.test.whole[0]
        assert row.test.interval.low <= row.test.whole[0] / 6 <= row.test.interval.high


def test_stages_come_in_order(tuned):
    steps = list(assess(tuned, features=Colours, n_resamples=2))
    assert list(dict.fromkeys(step.stage for step in steps)) == list(Stage)
    assert [step.assessment is None for step in steps] == [True] * (len(steps) - 1) + [False]


def test_without_a_search_it_says_what_to_do(make_project):
    project = make_project()
    project.fingerprint = "none"
    with pytest.raises(NothingToSearchError):
        next(assess(project))


def test_labels_are_suggested_and_only_accepted_ones_kept(tuned):
    from pictures import picture

    ids = [tuned.add(picture(100 + n), f"new{n}.png").image.id for n in range(3)]
    tuned.save()
    found, kept = results(tuned), assessed(tuned)
    before = hints(tuned, found, kept)
    assert (before.next, before.n_unasked) == ((), 3)
    list(ask_unlabelled(tuned, found, kept, MODEL))
    after = hints(tuned, found, kept)
    assert after.n_unasked == 0
    assert {one.image_id for one in after.next} == set(ids)
    recognizer = recognizer_with(tuned, found, kept, kept.recommendation.kind)
    states = {State.POSITIVE: 1, State.NEGATIVE: -1, State.UNKNOWN: 0}
    expected = {
        image_id: states[
            recognizer.recognize(tuned.image_path(tuned.images[image_id]), MODEL).state
        ]
        for image_id in ids
    }
    assert {one.image_id: one.label for one in after.suggestions} == {
        image_id: label for image_id, label in expected.items() if label
    }
    assert all(tuned.images[image_id].label is None for image_id in ids)
    accept(tuned, after.suggestions[:1])
    first = tuned.images[after.suggestions[0].image_id]
    assert (first.label, first.split) == (after.suggestions[0].label, Split.TRAIN)
    reopened = Project.open(tuned.folder)
    assert all(reopened.images[image_id].label is None for image_id in ids)
