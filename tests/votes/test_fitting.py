"""What is learned from training images: thresholds and weights, and which vote to recommend."""

from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from sklearn.linear_model import LogisticRegression
from vote_tables import COUNTED, skewed, table_of, tables

from vqa_state.votes import logistic
from vqa_state.votes.fitting import fit_vote, fit_votes
from vqa_state.votes.folds import stratified_folds
from vqa_state.votes.logistic import STRENGTHS, balanced, fit_logistic, solve
from vqa_state.votes.rules import Ballots, VoteKind
from vqa_state.votes.selection import NEAR, recommend, simplest_of_the_best


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

    def test_equal_means_are_equal_in_any_order_of_the_images(self):
        """As floats, thirds added up in another order differ in the last bit."""
        for order in permutations([1, 2, 3, 3]):
            positive = np.array([[n] for n in (*order, *order[::-1])])
            ballots = Ballots(positive, 3 - positive, 3)
            labels = np.array([1] * 4 + [-1] * 4, np.int8)
            assert fit_vote(VoteKind.THRESHOLD, ballots, labels, [0]).threshold == 0.5

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

    @pytest.mark.parametrize("shape", [(20, 64), (30, 5), (60, 60)])
    @pytest.mark.parametrize("spread", [0.01, 1, 30])
    def test_steps_of_large_fits_lead_to_the_same_place(self, monkeypatch, shape, spread):
        """All folds and strengths, once with the matrices of a step and once without."""
        rng = np.random.default_rng(shape)
        x = spread * rng.normal(size=shape) * rng.random(shape[1])
        labels = np.where(x[:, 0] + spread * rng.normal(size=shape[0]) > 0, 1, -1).astype(np.int8)
        labels[:2] = [1, -1]
        weights = np.stack([balanced(labels, rng.random(shape[0]) < 0.8) for _ in STRENGTHS])
        penalties = np.array(STRENGTHS) * (x**2).sum() / shape[0]
        few = solve(x, labels, weights, penalties)
        monkeypatch.setattr(logistic, "_FEW_COLUMNS", 0)
        many = solve(x, labels, weights, penalties)
        for one, other in zip(few, many, strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-6, atol=1e-8)

    def test_a_fit_of_hundreds_of_images_is_scikit_learns(self):
        rng = np.random.default_rng(5)
        x = rng.choice([-1.0, 0.0, 1.0], (260, 250))
        labels = np.where(x[:, :9].sum(axis=1) + rng.normal(size=260) > 0, 1, -1).astype(np.int8)
        mine = fit_logistic(x, labels, np.arange(260), STRENGTHS)
        spread = ((x - x.mean(axis=0)) ** 2).sum() / 260
        theirs = LogisticRegression(
            C=1 / (mine.strength * spread), class_weight="balanced", tol=1e-10, max_iter=10_000
        ).fit(x, labels)
        np.testing.assert_allclose(mine.coefficients, theirs.coef_[0], atol=1e-6)
        np.testing.assert_allclose(mine.intercept, theirs.intercept_[0], atol=1e-5)

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
        for last in (0.3, 0.1 + 0.2):
            three = {VoteKind.PAPER: 0.3, VoteKind.THRESHOLD: 0.3, VoteKind.WEIGHTED_ANSWERS: last}
            assert "best other one ('threshold')" in recommend(three, 20).reason
        for same in (0.3, 0.1 + 0.2):  # the same share, added up in another order
            equal = recommend({VoteKind.PAPER: 0.3, VoteKind.THRESHOLD: same}, 20)
            assert "no better" in equal.reason
