"""The trained rival against scikit-learn, and its features against the network's own tokens."""

import subprocess
import sys

import numpy as np
import pytest
from pictures import draw
from sklearn.linear_model import LogisticRegression
from sklearn.preprocessing import StandardScaler

from vqa_state.errors import NothingToSearchError
from vqa_state.evaluation.linear_probe import fit_linear_probe, linear_probe_out_of_bag
from vqa_state.evaluation.out_of_bag import out_of_bag
from vqa_state.models.embedded.pooled import PooledFeatures
from vqa_state.votes.resampling import divisible, draw_resample
from vqa_state.votes.rules import Ballots


def features_of(seed, labels, n_copies=4, n_features=30, noise=3.0):
    """A few features tell the states apart; copies of one image differ little."""
    rng = np.random.default_rng(seed)
    signal = np.zeros(n_features)
    signal[:4] = 2.0
    images = labels[:, None] * signal + rng.normal(0, noise, (len(labels), n_features)) + 5
    copies = images[:, None] + rng.normal(0, 0.3, (len(labels), n_copies, n_features))
    return copies.astype(np.float32)


LABELS = np.repeat(np.array([1, -1], np.int8), 10)


class TestRival:
    def test_its_odds_are_scikit_learns(self):
        train, new = features_of(0, LABELS), features_of(1, LABELS)
        rival = fit_linear_probe(train, LABELS)
        rows = train.astype(np.float64).mean(axis=1)
        scaler = StandardScaler().fit(rows)
        spread = (scaler.transform(rows) ** 2).sum() / len(rows)
        theirs = LogisticRegression(C=1 / (rival.strength * spread), tol=1e-9, max_iter=10_000)
        theirs.fit(scaler.transform(rows), LABELS)
        one_by_one = [
            theirs.decision_function(scaler.transform(new[:, copy].astype(np.float64)))
            for copy in range(4)
        ]
        np.testing.assert_allclose(rival.odds(new), np.mean(one_by_one, axis=0), atol=1e-4)

    def test_it_recognizes_new_images_where_there_is_a_signal(self):
        many = np.repeat(np.array([1, -1], np.int8), 200)
        rival = fit_linear_probe(features_of(0, LABELS), LABELS)
        new = features_of(1, many)
        assert rival.recognized(new, many).mean() > 0.7
        assert (rival.recognized(new, many) == (rival.decide(new) == many)).all()
        assert (rival.decide(new) == np.sign(rival.odds(new))).all()

    def test_labels_that_change_names_mirror_it(self):
        train = features_of(2, LABELS)
        one, other = fit_linear_probe(train, LABELS), fit_linear_probe(train[::-1], -LABELS[::-1])
        np.testing.assert_allclose(one.odds(train), -other.odds(train), atol=1e-6)

    def test_copies_of_look_alikes_never_validate_each_other(self):
        """Twins with random labels: kept together, the strongest penalty; parted, a weak one."""
        rng = np.random.default_rng(2)
        labels = np.repeat(rng.permutation(np.repeat([1, -1], 10)), 2).astype(np.int8)
        twins = np.repeat(rng.normal(size=(20, 1, 40)), 2, axis=0)
        features = np.tile(twins, (1, 2, 1)).astype(np.float32)
        together = fit_linear_probe(features, labels, np.arange(40) // 2)
        apart = fit_linear_probe(features, labels, rng.permutation(40))
        assert together.strength > apart.strength

    def test_a_feature_that_never_changes_means_nothing(self):
        train = features_of(3, LABELS)
        more = np.concatenate([train, np.full((20, 4, 1), 7, np.float32)], axis=2)
        one, other = fit_linear_probe(train, LABELS), fit_linear_probe(more, LABELS)
        np.testing.assert_allclose(one.odds(train), other.odds(more), atol=1e-8)

    def test_the_order_of_the_copies_means_nothing(self):
        train = features_of(4, LABELS)
        one, other = fit_linear_probe(train, LABELS), fit_linear_probe(train[:, ::-1], LABELS)
        np.testing.assert_allclose(one.odds(train), other.odds(train[:, ::-1]), atol=1e-6)

    def test_bad_arguments_are_refused(self):
        train = features_of(5, LABELS)
        rival = fit_linear_probe(train, LABELS)
        with pytest.raises(NothingToSearchError, match="both states"):
            fit_linear_probe(train, np.ones(20, np.int8))
        for bad in (train[:, 0], train[:3], np.full_like(train, np.nan)):
            with pytest.raises(ValueError):
                fit_linear_probe(bad, LABELS)
        for bad in (train[:, :0], train[:, :, :3], train[0]):
            with pytest.raises(ValueError, match="n_copies"):
                rival.odds(bad)


class TestOutOfBag:
    def test_every_bag_is_repeated_by_hand(self):
        """One image at a time, on the bags that the votes had."""
        train = features_of(6, LABELS, n_features=12)
        groups = np.arange(20) // 2
        ballots = Ballots(*np.ones((2, 20, 3), np.int64), n_copies=2)
        *_, votes = out_of_bag(
            ballots, LABELS, groups, seed=1, find=lambda counts, seed: (0,), n_resamples=7
        )
        bags = [resample.drawn for resample in votes.result().resamples]
        right = [[] for _ in LABELS]
        for bag, resample in zip(bags, votes.result().resamples, strict=True):
            assert set(np.flatnonzero(~resample.out)) == set(bag.tolist())
            rival = fit_linear_probe(train[bag], LABELS[bag], groups[bag])
            for image in set(range(20)) - set(bag.tolist()):
                right[image].append(rival.decide(train[[image]])[0] == LABELS[image])
        reports = list(linear_probe_out_of_bag(train, LABELS, groups, bags))
        assert [(r.n_done, r.n_total) for r in reports] == [(n, 7) for n in range(1, 8)]
        shares = [np.mean(of) if of else np.nan for of in right]
        np.testing.assert_allclose(reports[-1].recognized, shares)
        assert reports[-1].estimate.share == pytest.approx(np.nanmean(shares))
        assert reports[-1].estimate.positive == pytest.approx(np.nanmean(shares[:10]))

    def test_labels_without_a_signal_promise_nothing(self):
        rng = np.random.default_rng(0)
        shares = []
        for seed in range(8):
            labels = rng.permutation(LABELS)
            train = features_of(seed, LABELS)
            bags = bags_of(labels, seed)
            *_, last = linear_probe_out_of_bag(train, labels, np.arange(20), bags)
            assert fit_linear_probe(train, labels).recognized(train, labels).mean() > 0.7
            shares.append(last.estimate.share)
        assert 0.3 < np.mean(shares) < 0.62

    def test_it_foretells_new_images(self):
        """Of the same process, the mean over tasks is near the truth, a little below."""
        foretold, true = [], []
        many = np.repeat(np.array([1, -1], np.int8), 100)
        for seed in range(10):
            train, new = features_of(seed, LABELS), features_of(1000 + seed, many)
            *_, last = linear_probe_out_of_bag(train, LABELS, np.arange(20), bags_of(LABELS, seed))
            foretold.append(last.estimate.share)
            true.append(fit_linear_probe(train, LABELS).recognized(new, many).mean())
        assert abs(np.mean(foretold) - np.mean(true)) < 0.08

    def test_a_state_of_look_alikes_only_still_has_an_estimate(self):
        groups = np.array([0] * 10 + list(range(1, 11)))
        train = features_of(3, LABELS)
        kept = divisible(LABELS, groups)
        bags = [draw_resample(LABELS, kept, np.random.default_rng(n)) for n in range(6)]
        *_, last = linear_probe_out_of_bag(train, LABELS, groups, bags)
        assert 0 <= last.estimate.share <= 1


def bags_of(labels, seed, n_bags=12):
    rng = np.random.default_rng(seed)
    return [draw_resample(labels, np.arange(len(labels)), rng) for _ in range(n_bags)]


@pytest.fixture(scope="module")
def pooled():
    return PooledFeatures()


class TestPooledFeatures:
    def test_mean_and_largest_of_the_trunks_tokens(self, pooled):
        import torch

        from vqa_state.models.embedded.pixels import normalise, to_square
        from vqa_state.models.embedded.weights import load_network

        picture = draw(3, (90, 60))
        with torch.inference_mode():
            tokens = load_network().trunk(torch.from_numpy(normalise(to_square(picture)[None])))[0]
        (row,) = pooled([picture])
        assert row.shape == (pooled.n_features,) == (2 * tokens.shape[1],)
        assert row.dtype == np.float32
        expected = [*tokens.numpy().mean(axis=0), *tokens.numpy().max(axis=0)]
        np.testing.assert_allclose(row, expected, atol=1e-4)

    def test_one_row_a_picture_in_order_whatever_stands_beside_it(self, pooled):
        pictures = [draw(number) for number in range(11)]
        rows = list(pooled(pictures))
        assert len(rows) == 11
        for number in (0, 7, 10):
            (alone,) = pooled([pictures[number]])
            np.testing.assert_allclose(rows[number], alone, atol=1e-4)
        assert not np.allclose(rows[0], rows[1])
        assert list(pooled([])) == []

    def test_the_fingerprint_names_the_weights(self, pooled):
        from vqa_state.models.embedded.weights import weights_digest

        assert weights_digest() in pooled.fingerprint

    def test_naming_it_loads_nothing_heavy(self):
        code = (
            "import sys, vqa_state.models.embedded.pooled, vqa_state.evaluation.linear_probe; "
            "import vqa_state.evaluation.out_of_bag; "
            "sys.exit(any(name in sys.modules for name in ('torch', 'sklearn', 'scipy')))"
        )
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
