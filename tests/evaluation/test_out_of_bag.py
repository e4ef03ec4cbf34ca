"""The out-of-bag estimate against a literal repetition, and its laws."""

import math
from itertools import islice

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.stats import binomtest

from vqa_state.answers.rates import Counts
from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.estimates import Estimate, estimate, known_mean, optimism_warning
from vqa_state.evaluation.out_of_bag import out_of_bag, quick_search
from vqa_state.votes.fitting import fit_votes
from vqa_state.votes.resampling import divisible, draw_resample
from vqa_state.votes.rules import MILLION, Ballots, VoteKind
from vqa_state.votes.selection import simplest_of_the_best


def drawn(seed=0, n_images=12, n_questions=6, signal=0.5, n_copies=3):
    """Ballots with a signal, the first half of the positive state, and their labels."""
    rng = np.random.default_rng(seed)
    labels = np.where(np.arange(n_images) < n_images // 2, 1, -1).astype(np.int8)
    odds = signal * labels[:, None] * rng.uniform(0.2, 1.5, n_questions) + 0.3
    odds = odds + rng.normal(0, 0.8, odds.shape)
    positive = rng.binomial(n_copies, 1 / (1 + np.exp(-2 * odds)))
    p = np.rint(MILLION * n_copies / (1 + np.exp(-2 * odds))).astype(np.int64)
    return Ballots(positive, n_copies - positive, n_copies, p), labels


def first_two(counts: Counts, seed: int) -> tuple[int, ...]:
    """A search that needs no time; it leaves a trace of what it was given."""
    return (0, 1)


def last(reports):
    *_, report = reports
    return report.result()


class TestAgainstTheNaiveWay:
    @pytest.mark.parametrize("grouped", [False, True])
    def test_every_bag_is_repeated_one_image_at_a_time(self, grouped):
        ballots, labels = drawn(1)
        groups = np.arange(12) // (2 if grouped else 1)
        seen: list[Counts] = []

        def find(counts, seed):
            seen.append(counts)
            return (seed % 6,)

        found = last(out_of_bag(ballots, labels, groups, seed=3, find=find, n_resamples=8))
        right = {kind: [[] for _ in labels] for kind in VoteKind}
        lean = {kind: [[] for _ in labels] for kind in VoteKind}
        for resample, counts in zip(found.resamples, seen, strict=True):
            assert len(counts.labels) >= 2
            for image in np.flatnonzero(resample.out):
                alone = ballots.take(np.array([image]))
                for kind, vote in resample.votes.items():
                    right[kind][image].append(vote.decide(alone)[0] == labels[image])
                    lean[kind][image].append(vote.margins(alone)[0])
        for kind in VoteKind:
            shares = [np.mean(of) if of else np.nan for of in right[kind]]
            np.testing.assert_allclose(found.recognized[kind], shares)
            means = [np.mean(of) if of else np.nan for of in lean[kind]]
            np.testing.assert_allclose(found.margins[kind], means)
            assert found.kinds[kind].share == pytest.approx(np.nanmean(shares))
            assert found.kinds[kind].positive == pytest.approx(np.nanmean(shares[:6]))
            assert found.kinds[kind].negative == pytest.approx(np.nanmean(shares[6:]))

    def test_the_votes_are_those_of_the_bag(self):
        """A search that is handed the bag's counts; the fit sees nothing else."""
        ballots, labels = drawn(2)
        seen = []

        def find(counts, seed):
            seen.append(counts)
            return (2, 4)

        found = last(out_of_bag(ballots, labels, seed=0, find=find, n_resamples=5))
        for resample, counts in zip(found.resamples, seen, strict=True):
            inside = {tuple(row) for row in np.hstack([counts.correct, counts.wrong]).tolist()}
            own = ballots.counts(labels)
            for image in np.flatnonzero(~resample.out):
                row = [*own.correct[image].tolist(), *own.wrong[image].tolist()]
                assert tuple(row) in inside
            votes = fit_votes(Ballots.of_counts(counts), counts.labels, (2, 4))
            for kind in (VoteKind.PAPER, VoteKind.THRESHOLD):
                assert resample.votes[kind] == votes[kind]

    def test_the_choice_is_repeated_inside_every_bag(self):
        """Each bag chooses by its own images alone, and is judged on the others."""
        ballots, labels = drawn(5, n_images=16, signal=0.35)
        found = last(out_of_bag(ballots, labels, seed=1, n_resamples=12, find=first_two))
        right = [[] for _ in labels]
        n_chosen = set()
        rng_bags = bags_of(labels, np.arange(16), 1, 12)
        for resample, bag in zip(found.resamples, rng_bags, strict=True):
            assert (np.flatnonzero(~resample.out) == np.unique(bag)).all()
            inside = {k: float(np.nanmean(found.recognized[k][bag])) for k in found.kinds}
            kind = simplest_of_the_best(inside)
            n_chosen.add(kind)
            decided = resample.votes[kind].decide(ballots)
            for image in np.flatnonzero(resample.out):
                right[image].append(decided[image] == labels[image])
        assert len(n_chosen) > 1
        share = np.mean([np.mean(of) for of in right if of])
        assert found.recommended.share == pytest.approx(share)
        shares = {kind: e.share for kind, e in found.kinds.items()}
        assert found.recommendation.kind is simplest_of_the_best(shares)


def bags_of(labels, groups, seed, n_resamples):
    streams = np.random.SeedSequence([seed, *b"out of bag"]).spawn(n_resamples)
    return [draw_resample(labels, groups, np.random.Generator(np.random.PCG64(s))) for s in streams]


class TestReports:
    def test_one_a_resample_and_a_stop_keeps_what_is_done(self):
        ballots, labels = drawn()
        reports = list(out_of_bag(ballots, labels, seed=0, find=first_two, n_resamples=4))
        assert [(r.n_done, r.n_total) for r in reports] == [(n, 4) for n in (1, 2, 3, 4)]
        *_, stopped = islice(out_of_bag(ballots, labels, seed=0, find=first_two), 2)
        assert stopped.result().kinds == reports[1].result().kinds  # later bags change nothing
        assert len(stopped.result().resamples) == 2

    def test_the_same_seed_the_same_estimate(self):
        ballots, labels = drawn(3)
        one, two, other = (
            last(out_of_bag(ballots, labels, seed=seed, n_resamples=3)) for seed in (7, 7, 8)
        )
        assert one.kinds == two.kinds
        assert one.recommended == two.recommended
        np.testing.assert_array_equal(one.recommended_margins, two.recommended_margins)
        assert any(
            (a.out != b.out).any() for a, b in zip(one.resamples, other.resamples, strict=True)
        )

    def test_labels_without_a_signal_promise_nothing(self):
        """Training fits noise; out of bag, about half are recognized."""
        shares, trained = [], []
        for seed in range(6):
            ballots, _ = drawn(seed, n_images=20, n_questions=16, signal=0)
            labels = np.random.default_rng(seed).permutation(np.repeat([1, -1], 10)).astype(np.int8)
            found = last(out_of_bag(ballots, labels, seed=seed, n_resamples=6))
            shares.append(found.recommended.share)
            vote = fit_votes(ballots, labels, quick_search(ballots.counts(labels), 0))
            trained.append((vote[VoteKind.PAPER].decide(ballots) == labels).mean())
        assert np.mean(trained) > 0.7
        assert 0.3 < np.mean(shares) < 0.6

    def test_without_own_shares_there_is_no_vote_by_them(self):
        ballots, labels = drawn()
        plain = Ballots(ballots.positive, ballots.negative, ballots.n_copies)
        found = last(out_of_bag(plain, labels, seed=0, find=first_two, n_resamples=2))
        assert VoteKind.WEIGHTED_P_YES not in found.kinds
        assert set(found.margins) == set(found.kinds) == set(found.recognized)

    def test_one_question_is_searched_too(self):
        ballots, labels = drawn(n_questions=1)
        assert quick_search(ballots.counts(labels), 0) == (0,)

    @pytest.mark.parametrize(
        ("labels", "n_questions"), [([1, 1, 1, -1], 3), ([1, 1, 1, 1], 3), ([1, 1, -1, -1], 0)]
    )
    def test_too_little_is_said(self, labels, n_questions):
        ballots = Ballots(np.ones((4, n_questions), int), np.zeros((4, n_questions), int), 1)
        with pytest.raises(NothingToSearchError, match="two labelled training images of each"):
            next(out_of_bag(ballots, np.array(labels, np.int8), seed=0))

    def test_bad_arguments_are_refused(self):
        ballots, labels = drawn()
        for changed in (
            {"seed": -1},
            {"n_resamples": 0},
            {"groups": np.arange(3)},
            {"labels": labels[:3]},
        ):
            with pytest.raises(ValueError):
                next(out_of_bag(**({"ballots": ballots, "labels": labels, "seed": 0} | changed)))


@st.composite
def grouped(draw):
    n = draw(st.integers(4, 16))
    labels = draw(hnp.arrays(np.int8, n, elements=st.sampled_from([-1, 1])))
    groups = draw(hnp.arrays(np.int64, n, elements=st.integers(0, 6)))
    assume(min((labels == 1).sum(), (labels == -1).sum()) >= 2)
    return labels, groups


class TestBags:
    @given(grouped(), st.integers(0, 100))
    @settings(max_examples=60)
    def test_look_alikes_together_both_states_and_somebody_out(self, case, seed):
        labels, groups = case
        kept = divisible(labels, groups)
        bag = draw_resample(labels, kept, np.random.default_rng(seed))
        assert set(labels[bag].tolist()) == {1, -1}
        inside = np.isin(np.arange(len(labels)), bag)
        assert not inside.all()
        for group in set(kept.tolist()):
            assert len(set(inside[kept == group].tolist())) == 1
        if len(set(kept.tolist())) == len(labels):
            assert len(bag) == len(labels)

    @given(grouped())
    def test_only_the_single_group_of_a_state_is_parted(self, case):
        labels, groups = case
        kept = divisible(labels, groups)
        for state in (1, -1):
            assert len(set(kept[labels == state].tolist())) >= 2
        changed = {
            group for group, new in zip(groups.tolist(), kept.tolist(), strict=True) if group != new
        }
        lonely = {
            int(groups[labels == state][0])
            for state in (1, -1)
            if len(set(groups[labels == state].tolist())) == 1
        }
        assert changed == lonely

    @given(grouped())
    @settings(max_examples=15)
    def test_every_image_is_out_at_times(self, case):
        labels, groups = case
        kept = divisible(labels, groups)
        rng = np.random.default_rng(0)
        out = np.zeros(len(labels), bool)
        for _ in range(150):
            out[np.setdiff1d(np.arange(len(labels)), draw_resample(labels, kept, rng))] = True
        assert out.all()

    def test_each_state_keeps_its_size(self):
        labels = np.repeat(np.array([1, -1], np.int8), [3, 9])
        for seed in range(20):
            bag = draw_resample(labels, np.arange(12), np.random.default_rng(seed))
            assert (labels[bag] == 1).sum() == 3

    def test_parted_groups_are_said(self):
        ballots, labels = drawn()
        one_scene = np.where(labels == 1, 0, np.arange(12))
        parted, whole = (
            last(out_of_bag(ballots, labels, groups, seed=0, find=first_two, n_resamples=2))
            for groups in (one_scene, np.arange(12) // 2)
        )
        assert parted.groups_divided
        assert not whole.groups_divided


class TestEstimate:
    def test_the_interval_is_the_exact_one_where_the_number_is_whole(self):
        labels = np.repeat(np.array([1, -1], np.int8), 10)
        for n_right in (0, 1, 13, 20):
            right = (np.arange(20) < n_right).astype(float)
            found = estimate(right, labels, np.arange(20))
            exact = binomtest(n_right, 20).proportion_ci(0.95, "exact")
            assert (found.low, found.high) == pytest.approx((exact.low, exact.high))
            assert found.share == n_right / 20
            p = n_right / 20
            assert found.standard_error == pytest.approx(math.sqrt(p * (1 - p) / 20))

    def test_look_alikes_count_as_one(self):
        labels = np.repeat(np.array([1, -1], np.int8), 10)
        right = np.tile([1.0, 0.5], 10)
        alone, pairs = (estimate(right, labels, np.arange(20) // k) for k in (1, 2))
        assert pairs.share == alone.share
        assert pairs.standard_error == pytest.approx(alone.standard_error * math.sqrt(2))
        assert pairs.low < alone.low

    def test_images_never_out_are_left_out(self):
        labels = np.array([1, 1, -1, -1], np.int8)
        found = estimate(np.array([1, np.nan, 0.5, 0]), labels, np.arange(4))
        assert (found.share, found.positive, found.negative) == (0.5, 1.0, 0.25)
        empty = estimate(np.full(4, np.nan), labels, np.arange(4))
        assert all(math.isnan(getattr(empty, name)) for name in ("share", "low", "high"))

    def test_mean_of_what_is_known(self):
        values = np.array([[1, np.nan, np.nan], [0, 4, np.nan]])
        np.testing.assert_array_equal(known_mean(values), [0.5, 4, np.nan])


class TestWarning:
    HONEST = Estimate(0.85, 0.9, 0.8, 0.08, 0.6, 0.96)

    def test_only_where_training_promises_too_much(self):
        assert optimism_warning(0.9, self.HONEST, 20) is None
        assert optimism_warning(0.8, self.HONEST, 20) is None
        said = optimism_warning(1.0, self.HONEST, 20)
        assert "20 of 20" in said
        assert "17.0 of 20" in said
        assert "12.0 to 19.2" in said

    def test_one_image_is_nothing_to_warn_of(self):
        sure = Estimate(0.95, 1, 0.9, 0.001, 0.7, 1)
        assert optimism_warning(1.0, sure, 20) is None
        assert optimism_warning(1.0, sure, 200) is not None

    def test_an_unknown_estimate_warns_of_nothing(self):
        assert optimism_warning(1.0, Estimate(*[math.nan] * 6), 20) is None
