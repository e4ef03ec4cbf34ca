"""Train and test: each state divided by its share, look-alikes never on both sides."""

import hashlib
import random
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vqa_state.images.near_duplicates import LOOK_ALIKE_BITS, look_alikes
from vqa_state.project.split import Split, astride, divide

TRAIN, TEST, UNUSED = Split.TRAIN, Split.TEST, Split.UNUSED


def split(labels, groups=(), fixed=None, *, train_share=0.5, seed=0):
    return divide(labels, groups, fixed or {}, train_share=train_share, seed=seed)


def per_state(labels, sides):
    return Counter((labels[i], side) for i, side in sides.items())


@pytest.mark.parametrize(("share", "n_train"), [(0.5, 10), (0.8, 16), (0.25, 5)])
def test_each_state_is_divided_by_its_share(share, n_train):
    labels = {f"{n}": 1 if n < 20 else -1 for n in range(40)}
    counts = per_state(labels, split(labels, train_share=share))
    assert counts[1, TRAIN] == counts[-1, TRAIN] == n_train
    assert counts[1, TEST] == counts[-1, TEST] == 20 - n_train


def test_uneven_states_are_divided_on_their_own():
    labels = {f"{n}": 1 if n < 30 else -1 for n in range(34)}
    counts = per_state(labels, split(labels))
    assert (counts[1, TRAIN], counts[1, TEST]) == (15, 15)
    assert (counts[-1, TRAIN], counts[-1, TEST]) == (2, 2)


@given(st.data(), st.integers(0, 3), st.sampled_from([0.33, 0.5, 0.7]))
def test_each_goes_to_the_side_that_is_emptier_when_counted_anew(data, seed, share):
    """The plain way: in the same order, count all images at every turn."""
    labels = {
        f"i{n}": data.draw(st.sampled_from([1, -1])) for n in range(data.draw(st.integers(1, 12)))
    }
    kinds = data.draw(st.lists(st.integers(0, 4), min_size=len(labels), max_size=len(labels)))
    groups = [[i for i, k in zip(labels, kinds, strict=True) if k == kind] for kind in (1, 2)]
    fixed = {i: data.draw(st.sampled_from([TRAIN, TEST])) for i in list(labels)[:2]}
    sides = dict(fixed)

    def emptier(unit):
        states = {labels[i] for i in unit}
        n_train, n_test = (
            sum(s is side and labels[i] in states for i, s in sides.items())
            for side in (TRAIN, TEST)
        )
        return TRAIN if n_train / share <= n_test / (1 - share) else TEST

    units = [tuple(sorted(group)) for group in groups if group]
    units += [(i,) for i in labels if i not in {j for group in groups for j in group}]

    def turn(unit):
        return -len(unit), hashlib.sha256(f"{seed}:{unit[0]}".encode()).digest()

    for unit in sorted(units, key=turn):
        free = [i for i in unit if i not in fixed]
        before = {fixed[i] for i in unit if i in fixed}
        if len(before) == 2:
            for i in free:
                sides[i] = emptier([i])
        else:
            side = before.pop() if before else emptier(free)
            sides.update(dict.fromkeys(free, side))
    found = split(labels, groups, fixed, train_share=share, seed=seed)
    lone = {
        s
        for s in (1, -1)
        if len({sides[i] for i in labels if labels[i] == s}) < 2
        and sum(label == s for label in labels.values()) > 1
    }
    if not lone:  # else its groups are divided after all
        assert found == sides


def test_seeds_differ_and_repeat():
    labels = {f"{n}": 1 if n % 2 else -1 for n in range(40)}
    assert split(labels, seed=1) == split(labels, seed=1)
    assert len({tuple(sorted(split(labels, seed=s).items())) for s in range(5)}) == 5


def test_a_group_joins_the_side_of_its_members():
    labels = dict.fromkeys("abcdef", 1)
    for side in (TRAIN, TEST):
        sides = split(labels, [("a", "b", "c")], {"b": side})
        assert sides["a"] is sides["b"] is sides["c"] is side


def test_unused_images_stay_out_and_pull_nobody():
    labels = dict.fromkeys("abcd", 1)
    sides = split(labels, [("a", "b")], {"a": UNUSED})
    assert "a" not in sides
    assert set(sides) == set("bcd")


@pytest.mark.parametrize("share", [0, 1, -0.5, 1.5, float("nan")])
def test_a_share_must_leave_both_sides_something(share):
    with pytest.raises(ValueError, match="between 0 and 1"):
        split({"a": 1}, train_share=share)


def test_nothing_to_divide():
    assert split({}) == {}
    assert look_alikes({}) == []


ids = st.integers(0, 60).map("{:02}".format)
labelled = st.dictionaries(ids, st.sampled_from([1, -1]), max_size=40)
shares = st.floats(0.05, 0.95)


@st.composite
def divided(draw):
    """Labels, disjoint groups and fixed sides."""
    labels = draw(labelled)
    order = draw(st.permutations(sorted(labels)))
    groups = []
    while len(order) > 1:
        size = draw(st.integers(1, 5))
        group, order = order[:size], order[size:]
        if len(group) > 1:
            groups.append(tuple(group))
    fixed = draw(st.dictionaries(ids, st.sampled_from(Split), max_size=10))
    return labels, groups, fixed


@given(divided(), shares, st.integers(0, 9))
def test_every_labelled_image_gets_a_side(case, share, seed):
    labels, groups, fixed = case
    sides = split(labels, groups, fixed, train_share=share, seed=seed)
    assert set(sides) == set(labels) - {i for i, side in fixed.items() if side is UNUSED}
    assert set(sides.values()) <= {TRAIN, TEST}
    for i, side in fixed.items():
        assert side is UNUSED or i not in labels or sides[i] is side


@given(divided(), shares, st.integers(0, 9))
def test_groups_stay_whole_where_other_images_fill_both_sides(case, share, seed):
    labels, groups, _ = case
    others = {"x1": 1, "x2": 1, "y1": -1, "y2": -1}
    sides = split(labels | others, groups, train_share=share, seed=seed)
    assert all(len({sides[i] for i in group}) == 1 for group in groups)
    assert not astride(groups, sides)


@given(divided(), shares, st.integers(0, 9))
def test_every_state_with_two_images_is_on_both_sides(case, share, seed):
    labels, groups, _ = case
    sides = split(labels, groups, train_share=share, seed=seed)
    for state, total in Counter(labels.values()).items():
        assert total < 2 or {sides[i] for i in labels if labels[i] == state} == {TRAIN, TEST}


def test_a_camera_that_never_moves_still_gets_a_test():
    """All open pictures look alike, and so do all closed ones, added one by one."""
    labels, sides = {}, {}
    groups = [[f"open{n}" for n in range(10)], [f"closed{n}" for n in range(10)]]
    for n in range(10):
        labels |= {f"open{n}": 1, f"closed{n}": -1}
        sides = split(labels, groups, sides)
    assert sorted(per_state(labels, sides).values()) == [5, 5, 5, 5]
    assert astride(groups, sides) == groups


@given(divided(), shares, st.integers(0, 9))
def test_counts_are_within_the_largest_group_of_their_share(case, share, seed):
    labels, groups, _ = case
    sides = split(labels, groups, train_share=share, seed=seed)
    largest = max([len(group) for group in groups], default=1)
    for state, total in Counter(labels.values()).items():
        assert abs(per_state(labels, sides)[state, TRAIN] - share * total) <= largest


@given(divided(), shares, st.randoms(use_true_random=False))
def test_order_does_not_matter(case, share, rnd):
    labels, groups, fixed = case

    def shuffled(items):
        items = list(items)
        rnd.shuffle(items)
        return items

    again = split(
        dict(shuffled(labels.items())),
        [tuple(shuffled(group)) for group in shuffled(groups)],
        dict(shuffled(fixed.items())),
        train_share=share,
    )
    assert again == split(labels, groups, fixed, train_share=share)


@given(divided(), shares)
def test_dividing_again_changes_nothing(case, share):
    labels, groups, fixed = case
    sides = split(labels, groups, fixed, train_share=share)
    assert split(labels, groups, fixed | sides, train_share=share) == sides


def flip(value, *bits):
    for bit in bits:
        value ^= 1 << bit
    return f"{value:016x}"


def test_look_alikes_differ_in_few_bits():
    base = 0x123456789ABCDEF0
    near, far = flip(base, *range(LOOK_ALIKE_BITS)), flip(base, *range(LOOK_ALIKE_BITS + 1))
    assert look_alikes({"a": flip(base), "b": near}) == [("a", "b")]
    assert look_alikes({"a": flip(base), "b": far}) == []


def test_look_alikes_go_through_others():
    chain = {name: flip(0, *range(3 * n)) for n, name in enumerate("abcdef")}
    order = {name: chain[name] for name in "afcdbe"}
    assert [set(group) for group in look_alikes(order)] == [set("abcdef")]


@given(st.lists(st.integers(0, 2**64 - 1) | st.integers(0, 2**9), max_size=25))
def test_look_alikes_are_the_connected_ones(values):
    hashes = {f"{n}": f"{value:016x}" for n, value in enumerate(values)}
    reached = {i: {i} for i in hashes}
    for _ in hashes:  # the slow and plain way
        for one, other in ((a, b) for a in hashes for b in hashes):
            near = (int(hashes[one], 16) ^ int(hashes[other], 16)).bit_count()
            if near <= LOOK_ALIKE_BITS:
                reached[one] |= reached[other]
    expected = {frozenset(group) for group in reached.values() if len(group) > 1}
    found = look_alikes(hashes)
    assert {frozenset(group) for group in found} == expected
    assert len(found) == len(expected)


@pytest.mark.parametrize("n_kinds", [1, 50, 5000])
def test_five_thousand_images(n_kinds):
    rng = random.Random(0)
    kinds = [f"{rng.getrandbits(64):016x}" for _ in range(n_kinds)]
    hashes = {f"{n}": rng.choice(kinds) for n in range(5000)}
    groups = look_alikes(hashes)
    assert len(groups) <= n_kinds
    assert all(len({hashes[i] for i in group}) == 1 for group in groups)
