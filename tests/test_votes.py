"""Kinds of vote against the paper's rule in whole numbers, fractions, and scikit-learn."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sklearn.linear_model import LogisticRegression

from vqa_state.answers import MISSING, AnswerTable
from vqa_state.questions import Question
from vqa_state.scores import count, score
from vqa_state.voting.choosing import NEAR, recommend, simplest_of_the_best
from vqa_state.voting.fitting import available_kinds, fit_vote, fit_votes
from vqa_state.voting.folds import stratified_folds
from vqa_state.voting.kinds import MAX_WEIGHT, MILLION, Ballots, FittedVote, VoteKind, support
from vqa_state.voting.logistic import STRENGTHS, balanced, fit_logistic, solve

COUNTED = [VoteKind.PAPER, VoteKind.THRESHOLD, VoteKind.WEIGHTED_ANSWERS]


def table_of(verdicts, labels, p_positive=None) -> AnswerTable:
    verdicts = np.asarray(verdicts, dtype=np.int8)
    if p_positive is None:
        p_positive = np.full(verdicts.shape, np.nan)
    return AnswerTable(
        image_ids=tuple(f"image{i}" for i in range(verdicts.shape[0])),
        questions=tuple(Question(f"Is it {q}?", yes_means=1) for q in range(verdicts.shape[2])),
        verdicts=verdicts,
        p_positive=np.asarray(p_positive, dtype=np.float32),
        labels=np.asarray(labels, dtype=np.int8),
    )


@st.composite
def tables(draw, min_images=1) -> AnswerTable:
    """Small tables with shares; the first two images have different states."""
    n_images = draw(st.integers(min_images, 8))
    shape = (n_images, draw(st.integers(1, 3)), draw(st.integers(1, 5)))
    verdicts = draw(hnp.arrays(np.int8, shape, elements=st.sampled_from([-1, 0, 1])))
    p = draw(hnp.arrays(np.float32, shape, elements=st.floats(0, 1, width=32)))
    labels = draw(hnp.arrays(np.int8, shape[:1], elements=st.sampled_from([-1, 1])))
    labels[:2] = [1, -1][:n_images]
    return table_of(verdicts, labels, p)


@st.composite
def votes(draw, n_questions, kinds=tuple(VoteKind)) -> FittedVote:
    chosen = draw(st.sets(st.integers(0, n_questions - 1), min_size=1))
    size = {"min_size": len(chosen), "max_size": len(chosen)}
    return FittedVote(
        kind=draw(st.sampled_from(kinds)),
        questions=tuple(sorted(chosen)),
        weights=tuple(draw(st.lists(st.integers(1, 20), **size))),
        flipped=tuple(draw(st.lists(st.booleans(), **size))),
        threshold=draw(st.sampled_from([0.25, 0.4, 0.5, 0.6, 1 / 8, 0.333333])),
    )


def literal_share(vote, verdicts, p) -> Fraction | None:
    """One answer at a time; (n_copies, n_questions) of one image."""
    positive = total = Fraction(0)
    for question, weight, flipped in zip(vote.questions, vote.weights, vote.flipped, strict=True):
        for said, sure in zip(verdicts[:, question], p[:, question], strict=True):
            said, sure = (-said, 1 - float(sure)) if flipped else (said, float(sure))
            if vote.kind is VoteKind.WEIGHTED_P_YES:
                given = Fraction(round(sure * MILLION), MILLION)
            elif vote.kind is VoteKind.WEIGHTED_ANSWERS:
                given = Fraction(1 + int(said), 2)
            elif said == 0:
                continue
            else:
                given = Fraction(int(said == 1))
            positive += weight * given
            total += weight
    if vote.kind is VoteKind.WEIGHTED_ANSWERS and not verdicts[:, list(vote.questions)].any():
        return None
    return positive / total if total else None


class TestDeciding:
    @given(st.data())
    @settings(max_examples=150)
    def test_as_one_answer_at_a_time_in_fractions(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        decided = vote.decide(Ballots.of_table(table))
        shares = vote.shares(Ballots.of_table(table))
        threshold = Fraction(round(vote.threshold * MILLION), MILLION)
        for image in range(table.n_images):
            share = literal_share(vote, table.verdicts[image], table.p_positive[image])
            if share is None:
                assert decided[image] == 0
                assert np.isnan(shares[image])
            else:
                assert decided[image] == (share > threshold) - (share < threshold)
                assert shares[image] == pytest.approx(float(share), abs=1e-12)

    @given(st.data())
    @settings(max_examples=100)
    def test_a_recognizer_that_adds_support_says_the_same(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        decided = vote.decide(Ballots.of_table(table))
        for image in range(table.n_images):
            positive = total = 0
            for copy in range(table.n_copies):
                for question, weight, flipped in zip(
                    vote.questions, vote.weights, vote.flipped, strict=True
                ):
                    said = int(table.verdicts[image, copy, question])
                    p = float(table.p_positive[image, copy, question])
                    own = support(vote.kind, -said if flipped else said, 1 - p if flipped else p)
                    if own is not None:
                        positive += weight * own
                        total += weight * MILLION
            at = round(vote.threshold * total)
            nothing = (
                vote.kind is VoteKind.WEIGHTED_ANSWERS
                and not table.verdicts[image][:, list(vote.questions)].any()
            )
            expected = 0 if nothing else (positive > at) - (positive < at)
            assert decided[image] == expected

    @given(st.data())
    def test_the_papers_vote_is_the_papers_rule(self, data):
        table = data.draw(tables(min_images=2))
        subset = data.draw(st.sets(st.integers(0, table.n_questions - 1), min_size=1))
        vote = fit_vote(VoteKind.PAPER, Ballots.of_table(table), table.labels, sorted(subset))
        assert (set(vote.weights), vote.threshold) == ({1}, 0.5)
        recognized = vote.decide(Ballots.of_table(table)) == table.labels
        assert (recognized == score(count(table), sorted(subset)).recognized).all()

    @given(st.data())
    def test_margins_have_the_verdicts_sign_and_reach_one(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        ballots = Ballots.of_table(table)
        margins, shares = vote.margins(ballots), vote.shares(ballots)
        assert (np.sign(margins) == vote.decide(ballots)).all()
        assert (np.abs(margins) <= 1).all()
        assert (margins[shares == 1] == 1).all()
        assert (margins[shares == 0] == -1).all()

    @given(st.data(), st.integers(2, 50))
    def test_scaled_weights_change_nothing(self, data, factor):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        scaled = tuple(factor * weight for weight in vote.weights)
        other = FittedVote(vote.kind, vote.questions, scaled, vote.flipped, vote.threshold)
        ballots = Ballots.of_table(table)
        assert (vote.decide(ballots) == other.decide(ballots)).all()
        np.testing.assert_array_equal(vote.shares(ballots), other.shares(ballots))

    @given(st.data())
    def test_turned_verdicts_turn_the_decision(self, data):
        table = data.draw(tables())
        vote = data.draw(votes(table.n_questions))
        turned = table_of(-table.verdicts, -table.labels, 1 - table.p_positive.astype(np.float64))
        other = FittedVote(
            vote.kind, vote.questions, vote.weights, vote.flipped, round(1 - vote.threshold, 6)
        )
        before, after = Ballots.of_table(table), Ballots.of_table(turned)
        assume(vote.kind is not VoteKind.WEIGHTED_P_YES)  # float32 holds p and 1 - p unlike
        assert (vote.decide(before) == -other.decide(after)).all()

    @pytest.mark.parametrize(
        ("n_for", "n_all", "threshold"), [(3, 5, 0.6), (3, 10, 0.3), (29, 50, 0.58), (63, 90, 0.7)]
    )
    def test_a_tie_is_exact_where_floats_are_not(self, n_for, n_all, threshold):
        """In floats, 0.58 * 50 million and 0.7 * 90 million fall short of a whole number."""
        ballots = Ballots(np.array([[n_for]]), np.array([[n_all - n_for]]), n_all)
        vote = FittedVote(VoteKind.THRESHOLD, (0,), (1,), (False,), threshold)
        assert vote.decide(ballots)[0] == 0

    def test_no_valid_answer_is_unknown_whatever_the_threshold(self):
        ballots = Ballots(np.zeros((1, 2), int), np.zeros((1, 2), int), 6)
        for kind in COUNTED:
            vote = FittedVote(kind, (0, 1), (3, 1), (False, True), 0.2)
            assert vote.decide(ballots)[0] == 0
            assert vote.margins(ballots)[0] == 0

    @pytest.mark.parametrize(
        "changed",
        [
            {"weights": (0, 1)},
            {"weights": (1,)},
            {"weights": (1, MAX_WEIGHT + 1)},
            {"weights": (1, 1.5)},
            {"questions": (1, 0)},
            {"questions": (0, 0)},
            {"threshold": 0.0},
            {"threshold": 1.0},
            {"threshold": 0.12345678},
            {"questions": (), "weights": (), "flipped": ()},
        ],
    )
    def test_a_vote_refuses_what_a_file_must_not_hold(self, changed):
        good = {"questions": (0, 1), "weights": (1, 2), "flipped": (False,) * 2, "threshold": 0.5}
        FittedVote(VoteKind.PAPER, **good)
        with pytest.raises(ValueError):
            FittedVote(VoteKind.PAPER, **(good | changed))

    def test_p_yes_must_be_known(self):
        vote = FittedVote(VoteKind.WEIGHTED_P_YES, (0,), (1,), (False,), 0.5)
        unknown = Ballots.of_table(table_of([[[1]], [[-1]]], [1, -1]))
        with pytest.raises(ValueError, match="own share"):
            vote.decide(unknown)
        with pytest.raises(ValueError, match="p_yes"):
            support(VoteKind.WEIGHTED_P_YES, 1)
        with pytest.raises(ValueError, match="own share"):
            fit_vote(VoteKind.WEIGHTED_P_YES, unknown, np.array([1, -1], np.int8), [0])


class TestBallots:
    @given(tables())
    def test_the_counts_are_those_of_the_table(self, table):
        made, counted = Ballots.of_table(table).counts(table.labels), count(table)
        for kind in ("correct", "wrong", "invalid", "labels"):
            assert (getattr(made, kind) == getattr(counted, kind)).all()
        back = Ballots.of_counts(counted)
        assert (back.positive == Ballots.of_table(table).positive).all()
        assert (back.negative == Ballots.of_table(table).negative).all()
        assert back.n_copies == table.n_copies

    def test_refuse_what_cannot_be(self):
        one, two = np.array([[1]]), np.array([[2]])
        with pytest.raises(ValueError, match="missing"):
            Ballots.of_table(table_of([[[MISSING]]], [1]))
        with pytest.raises(ValueError, match="copies"):
            Ballots(one, two, 2)
        with pytest.raises(ValueError, match="negative"):
            Ballots(-one, one, 2)
        with pytest.raises(ValueError, match="shape"):
            Ballots(one, np.array([[1, 1]]), 2)
        with pytest.raises(ValueError, match="above 1"):
            Ballots(one, one, 2, 2 * MILLION * np.array([[2]]))

    def test_one_unknown_share_leaves_the_kind_out(self):
        known = table_of([[[1, 1]], [[1, -1]]], [1, -1], [[[0.9, 0.8]], [[0.7, 0.1]]])
        some = table_of([[[1, 1]], [[1, -1]]], [1, -1], [[[0.9, np.nan]], [[0.7, 0.1]]])
        assert available_kinds(Ballots.of_table(known)) == tuple(VoteKind)
        assert available_kinds(Ballots.of_table(some)) == tuple(COUNTED)


def skewed(seed, n_images=20, n_questions=12, n_copies=6) -> AnswerTable:
    """Answers that lean to the positive state, with a real signal; p is sure where answers are."""
    rng = np.random.default_rng(seed)
    labels = np.where(np.arange(n_images) < n_images // 2, 1, -1)
    evidence = (
        labels[:, None, None] * rng.uniform(0, 1.2, n_questions)
        + 0.8
        + rng.normal(0, 0.7, (n_images, 1, n_questions))
        + rng.normal(0, 0.3, (n_images, n_copies, n_questions))
    )
    verdicts = np.where(np.abs(evidence) < 0.1, 0, np.sign(evidence))
    return table_of(verdicts, labels, 1 / (1 + np.exp(-2 * evidence)))


class TestThreshold:
    @given(tables(min_images=2))
    def test_it_stands_midway_between_the_mean_shares(self, table):
        ballots, everything = Ballots.of_table(table), range(table.n_questions)
        vote = fit_vote(VoteKind.THRESHOLD, ballots, table.labels, everything)
        shares = {1: [], -1: []}
        for image, label in enumerate(table.labels.tolist()):
            said = table.verdicts[image]
            if said.any():
                shares[label].append(Fraction(int((said > 0).sum()), int((said != 0).sum())))
        means = [sum(of, Fraction(0)) / len(of) if of else None for of in shares.values()]
        if None in means or means[0] <= means[1]:
            assert vote.threshold == 0.5
        else:
            assert vote.threshold == pytest.approx(float(sum(means) / 2), abs=1.01e-6)

    def test_leaning_answers_are_recognized_after_all(self):
        """All images get most answers for the positive state; only how many tells them apart."""
        ballots = Ballots(np.array([[6], [5], [4], [4]]), np.array([[0], [1], [2], [2]]), 6)
        labels = np.array([1, 1, -1, -1], np.int8)
        fitted = fit_votes(ballots, labels, [0])
        paper, threshold = (fitted[k].decide(ballots) for k in COUNTED[:2])
        assert paper.tolist() == [1, 1, 1, 1]
        assert threshold.tolist() == labels.tolist()

    @given(tables(min_images=2), st.randoms(use_true_random=False))
    def test_the_order_of_images_and_questions_means_nothing(self, table, random):
        images = random.sample(range(table.n_images), table.n_images)
        questions = random.sample(range(table.n_questions), table.n_questions)
        turned = table_of(table.verdicts[images][:, :, questions], table.labels[images])
        everything = range(table.n_questions)
        first, second = (
            fit_vote(VoteKind.THRESHOLD, Ballots.of_table(t), t.labels, everything)
            for t in (table, turned)
        )
        assert first.threshold == pytest.approx(second.threshold, abs=1.01e-6)

    @given(tables(min_images=2))
    def test_states_that_change_names_mirror_it(self, table):
        turned = table_of(-table.verdicts, -table.labels)
        first, second = (
            fit_vote(VoteKind.THRESHOLD, Ballots.of_table(t), t.labels, [0]).threshold
            for t in (table, turned)
        )
        assert first == pytest.approx(1 - second, abs=2e-6)

    def test_without_a_state_there_is_nothing_to_learn(self):
        ballots = Ballots.of_table(table_of([[[1]], [[1]]], [1, 1]))
        for kind in COUNTED:
            with pytest.raises(ValueError, match="both present"):
                fit_vote(kind, ballots, np.array([1, 1], np.int8), [0])


class TestWeighted:
    @pytest.mark.parametrize("kind", [VoteKind.WEIGHTED_ANSWERS, VoteKind.WEIGHTED_P_YES])
    @pytest.mark.parametrize("seed", range(6))
    def test_it_decides_as_scikit_learns_model(self, kind, seed):
        """At the strength that was chosen; three digits of weight may only move what is close."""
        table, new = skewed(seed), skewed(100 + seed, n_images=200)
        features = {
            VoteKind.WEIGHTED_ANSWERS: lambda t: t.verdicts.mean(axis=1),
            VoteKind.WEIGHTED_P_YES: lambda t: 2 * t.p_positive.astype(np.float64).mean(axis=1) - 1,
        }[kind]
        x = features(table)
        strength = fit_logistic(x, table.labels, np.arange(20)).strength
        spread = ((x - x.mean(axis=0)) ** 2).sum() / 20
        theirs = LogisticRegression(C=1 / (strength * spread), tol=1e-9, max_iter=10_000)
        theirs.fit(x, table.labels)
        odds = theirs.decision_function(features(new))
        vote = fit_vote(kind, Ballots.of_table(table), table.labels, [0])
        clear = np.abs(odds) > 0.01 * np.abs(theirs.coef_).sum()
        assert clear.mean() > 0.8
        assert (vote.decide(Ballots.of_table(new)) == np.sign(odds))[clear].all()

    @pytest.mark.parametrize("kind", list(VoteKind))
    def test_new_questions_order_moves_the_weights_along(self, kind):
        table = skewed(1)
        turn = np.random.default_rng(0).permutation(table.n_questions)
        turned = table_of(table.verdicts[:, :, turn], table.labels, table.p_positive[:, :, turn])
        subset = [1, 4, 5]
        first = fit_vote(kind, Ballots.of_table(table), table.labels, subset)
        moved = [int(np.flatnonzero(turn == q)[0]) for q in subset]
        second = fit_vote(kind, Ballots.of_table(turned), table.labels, moved)
        assert dict(zip(first.questions, first.weights, strict=True)) == {
            int(turn[q]): w for q, w in zip(second.questions, second.weights, strict=True)
        }
        assert first.threshold == pytest.approx(second.threshold, abs=1e-6)

    def test_states_that_change_names_mirror_it(self):
        """The strata of the folds change places, so the strength may, too; here it does not."""
        table = skewed(2)
        turned = table_of(-table.verdicts, -table.labels)
        first, second = (
            fit_vote(VoteKind.WEIGHTED_ANSWERS, Ballots.of_table(t), t.labels, [0])
            for t in (table, turned)
        )
        assert first.weights == second.weights
        assert first.flipped == second.flipped
        assert first.threshold == pytest.approx(1 - second.threshold, abs=2e-6)

    def test_a_question_that_means_the_opposite_is_flipped(self):
        table = skewed(3)
        table.verdicts[:, :, 2] = -table.labels[:, np.newaxis]
        vote = fit_vote(VoteKind.WEIGHTED_ANSWERS, Ballots.of_table(table), table.labels, [0])
        assert vote.flipped[vote.questions.index(2)]
        assert (vote.decide(Ballots.of_table(table)) == table.labels).all()

    def test_answers_that_never_differ_teach_nothing(self):
        table = table_of(np.ones((4, 2, 3)), [1, 1, -1, -1])
        vote = fit_vote(VoteKind.WEIGHTED_ANSWERS, Ballots.of_table(table), table.labels, [0])
        assert (vote.questions, vote.weights, vote.threshold) == ((0, 1, 2), (1, 1, 1), 0.5)

    def test_the_same_arguments_give_the_same_vote(self):
        table = skewed(4)
        made = [fit_votes(Ballots.of_table(table), table.labels, [0, 3]) for _ in range(2)]
        assert made[0] == made[1]
        assert list(made[0]) == list(VoteKind)


class TestLogistic:
    @pytest.mark.parametrize("shape", [(20, 64), (30, 5), (12, 12)])
    @pytest.mark.parametrize("strength", STRENGTHS)
    def test_the_optimum_is_scikit_learns(self, shape, strength):
        rng = np.random.default_rng(shape)
        x = rng.normal(size=shape) + 3
        labels = np.where(rng.random(shape[0]) < 0.3, 1, -1).astype(np.int8)
        labels[:2] = [1, -1]
        mine = fit_logistic(x, labels, np.arange(shape[0]), (strength,))
        spread = ((x - x.mean(axis=0)) ** 2).sum() / shape[0]
        theirs = LogisticRegression(
            C=1 / (strength * spread), class_weight="balanced", tol=1e-10, max_iter=10_000
        ).fit(x, labels)
        np.testing.assert_allclose(mine.coefficients, theirs.coef_[0], atol=1e-6)
        np.testing.assert_allclose(mine.intercept, theirs.intercept_[0], atol=1e-4)

    def test_the_strength_is_the_one_with_the_least_loss_on_left_out_folds(self):
        """The naive way: one scikit-learn fit for each strength and fold."""
        chosen = set()
        for seed in range(5):
            rng = np.random.default_rng(seed)
            labels = np.repeat(np.array([1, -1], np.int8), 10)
            x = rng.normal(size=(20, 6)) + labels[:, None] * rng.uniform(0, 1) * rng.random(6)
            groups = np.arange(20) // 2
            folds = stratified_folds(labels, groups, 5)
            spread = ((x - x.mean(axis=0)) ** 2).sum() / 20
            losses = []
            for strength in STRENGTHS:
                model = LogisticRegression(
                    C=1 / (strength * spread), class_weight="balanced", tol=1e-6, max_iter=10_000
                )
                loss = 0.0
                for fold in range(5):
                    held = folds == fold
                    odds = model.fit(x[~held], labels[~held]).decision_function(x[held])
                    loss += np.logaddexp(0, -labels[held] * odds).sum()
                losses.append(loss)
            mine = fit_logistic(x, labels, groups).strength
            assert mine == STRENGTHS[int(np.argmin(losses))]
            chosen.add(mine)
        assert len(chosen) > 1

    def test_steps_that_overshoot_are_halved(self):
        """Drawn at random: here the sixth full Newton step raises the loss from 2 to 8,875."""
        x = np.array([6.1, 0.3, 0.1, -0.1, 0.4, -1.9, -33.2])
        labels = np.array([1, -1, -1, -1, 1, 1, -1], np.int8)
        weights = np.array([0.95, 122.74, 20.03, 0.45, 0.09, 0.04, 6.61])
        w, b = solve(x[:, np.newaxis], labels, weights[np.newaxis], [1e-4])
        residuals = weights * labels / (1 + np.exp(labels * (x * w[0, 0] + b[0])))
        assert 1e-4 * w[0, 0] - residuals @ x == pytest.approx(0, abs=1e-6)
        assert residuals.sum() == pytest.approx(0, abs=1e-6)

    @pytest.mark.parametrize("factor", [0.001, 1000.0])
    def test_the_features_unit_means_nothing(self, factor):
        rng = np.random.default_rng(1)
        x, labels = rng.normal(size=(16, 4)), np.repeat(np.array([1, -1], np.int8), 8)
        one, other = (fit_logistic(f * x, labels, np.arange(16)) for f in (1.0, factor))
        assert one.strength == other.strength
        np.testing.assert_allclose(one.decision(x), other.decision(factor * x), atol=1e-7)

    def test_both_states_weigh_the_same(self):
        labels = np.array([1, -1, -1, -1], np.int8)
        assert balanced(labels).tolist() == pytest.approx([2, 2 / 3, 2 / 3, 2 / 3])
        used = np.array([True, True, True, False])
        assert balanced(labels, used).tolist() == pytest.approx([1.5, 0.75, 0.75, 0])

    def test_refuses_what_it_cannot_learn_from(self):
        x, labels = np.ones((2, 1)), np.array([1, -1], np.int8)
        for bad in (
            (np.full((2, 1), np.nan), labels, np.arange(2)),
            (x, np.array([1, 1], np.int8), np.arange(2)),
            (x, labels, np.arange(3)),
        ):
            with pytest.raises(ValueError):
                fit_logistic(*bad)


class TestFolds:
    @given(st.data())
    def test_look_alikes_together_and_both_states_left(self, data):
        n = data.draw(st.integers(2, 20))
        labels = data.draw(hnp.arrays(np.int8, n, elements=st.sampled_from([-1, 1])))
        groups = data.draw(hnp.arrays(np.int64, n, elements=st.integers(0, 8)))
        assume(len(set(labels.tolist())) == 2)
        folds = stratified_folds(labels, groups, 5)
        for group in set(groups.tolist()):
            assert len(set(folds[groups == group].tolist())) == 1
        n_folds = folds.max() + 1
        fewest = min(len(set(groups[labels == state].tolist())) for state in (1, -1))
        assert n_folds == min(5, fewest)
        if n_folds > 1:
            for fold in range(n_folds):
                assert set(labels[folds != fold].tolist()) == {1, -1}


class TestRecommending:
    def test_the_simplest_of_the_near_best(self):
        shares = {VoteKind.PAPER: 0.8, VoteKind.THRESHOLD: 0.85, VoteKind.WEIGHTED_ANSWERS: 0.86}
        assert simplest_of_the_best(shares) is VoteKind.THRESHOLD
        assert simplest_of_the_best(shares | {VoteKind.WEIGHTED_ANSWERS: 0.9}) is (
            VoteKind.WEIGHTED_ANSWERS
        )
        assert simplest_of_the_best(shares | {VoteKind.PAPER: 0.86 - NEAR}) is VoteKind.PAPER

    def test_unknown_shares_recommend_the_paper(self):
        nothing = dict.fromkeys(COUNTED, float("nan"))
        assert simplest_of_the_best(nothing) is VoteKind.PAPER
        assert "never" not in recommend({VoteKind.PAPER: 0.9}, 20).reason
        assert "ever out of bag" in recommend(nothing, 20).reason
        with pytest.raises(ValueError, match="no kind"):
            simplest_of_the_best({})

    def test_the_reason_names_both_numbers(self):
        found = recommend({VoteKind.PAPER: 0.8, VoteKind.THRESHOLD: 0.9}, 20)
        assert found.kind is VoteKind.THRESHOLD
        assert "18.0 of 20" in found.reason
        assert "16.0 of 20" in found.reason
        close = recommend({VoteKind.PAPER: 0.8, VoteKind.THRESHOLD: 0.81}, 20)
        assert close.kind is VoteKind.PAPER
        assert "too little more" in close.reason
