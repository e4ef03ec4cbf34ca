"""Whether one recognizer is better than another, or was lucky: exact paired tests, in words.

Two recognizers are compared on the same images. Images that both recognize, or both miss, say
nothing about which is better; what is left is a coin that each such image tosses.

Source: Q. McNemar, "Note on the sampling error of the difference between correlated proportions",
Psychometrika 1947 (here in its exact form); S. Holm, "A simple sequentially rejective multiple
test procedure", Scandinavian Journal of Statistics 1979.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "LEVEL",
    "MAX_IMAGES",
    "POWER",
    "Comparison",
    "PairedTest",
    "compare",
    "holm",
    "images_needed",
    "mcnemar",
    "power",
]

LEVEL = 0.05
"""A difference that luck alone gives at most this often counts as real."""

POWER = 0.8
"""How surely the number of needed images would show a difference as large as the one seen."""

MAX_IMAGES = 100_000
"""No larger number of needed images is told: nobody will take so many photos."""

_SPREAD = 9.0  # standard deviations; what lies further out cannot be seen in a float's power


@dataclass(frozen=True, slots=True)
class PairedTest:
    """Two recognizers on the same images; only images that one of them alone recognizes count.

    Attributes:
        n_images: images that both were tried on.
        n_only_first: images that only the first recognizes.
        n_only_second: images that only the second recognizes.

    Raises:
        ValueError: if a number is negative, or the two parts exceed the images.
    """

    n_images: int
    n_only_first: int
    n_only_second: int

    def __post_init__(self) -> None:
        if min(self.n_only_first, self.n_only_second) < 0 or self.n_differing > self.n_images:
            raise ValueError(
                f"{self.n_only_first} and {self.n_only_second} images that one recognizer alone "
                f"recognizes must be parts of all {self.n_images} images"
            )

    @property
    def n_differing(self) -> int:
        """Images that exactly one of the two recognizes."""
        return self.n_only_first + self.n_only_second

    @property
    def difference(self) -> int:
        """How many more images the first recognizes; negative if fewer."""
        return self.n_only_first - self.n_only_second

    @property
    def p_value(self) -> float:
        """Chance of a difference at least so large if both were equally good, in [0, 1].

            p = min(1, 2 * P(X <= min(n_only_first, n_only_second))), X ~ Binomial(n_differing, 1/2)

        Two-sided and exact; 1 if the two never differ. Source: McNemar 1947, exact form.
        """
        ways = tail = 1  # to pick k of the differing images, for k = 0; and summed up
        for k in range(min(self.n_only_first, self.n_only_second)):
            ways = ways * (self.n_differing - k) // (k + 1)
            tail += ways
        return float(min(1.0, 2 * tail / 2**self.n_differing))


def mcnemar(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> PairedTest:
    """Compare two recognizers.

    Args:
        first: which images the first recognizes, bool (n_images,).
        second: which of the same images, in the same order, the second recognizes.

    Raises:
        ValueError: if the two are not of the same images.
    """
    if first.shape != second.shape or first.ndim != 1:
        raise ValueError(f"need the same images, got {first.shape} and {second.shape}")
    return PairedTest(
        n_images=first.size,
        n_only_first=int(np.count_nonzero(first & ~second)),
        n_only_second=int(np.count_nonzero(second & ~first)),
    )


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Holm's corrected p-values, in the order of the given ones.

    Whoever looks at many comparisons finds a lucky one. Sorted ascending, the i-th of m p-values
    (from 0) is multiplied by m - i; a corrected value is never below an earlier one nor above 1.
    Calling real what is at most 0.05 then errs at all in at most 5 % of such tables.

    Raises:
        ValueError: if a p-value is not in [0, 1].

    Source: Holm 1979.
    """
    if not all(0 <= p <= 1 for p in p_values):
        raise ValueError(f"p-values must be in [0, 1], got {p_values}")
    corrected = [0.0] * len(p_values)
    highest = 0.0
    for place, factor in _holm_factors(p_values):
        highest = max(highest, min(1.0, factor * p_values[place]))
        corrected[place] = highest
    return tuple(corrected)


def power(n_images: int, only_first: float, only_second: float, level: float = LEVEL) -> float:
    """Chance that a paired test of so many images shows that the first is better, in [0, 1].

    The number of differing images is D ~ Binomial(n_images, only_first + only_second); of d
    differing ones, Binomial(d, only_second / (only_first + only_second)) speak for the second.
    The test is passed if these are so few that the exact two-sided p-value is at most `level`.

    Args:
        n_images: 0 or more.
        only_first: share of images that only the first recognizes, in [0, 1].
        only_second: share that only the second recognizes; together at most 1.
        level: p-value that counts as real, in (0, 1).
    """
    from scipy.stats import binom  # takes half a second to import

    differing = min(only_first + only_second, 1.0)
    if n_images == 0 or differing == 0:
        return 0.0
    mean, width = n_images * differing, math.sqrt(n_images * differing * (1 - differing))
    low = max(0, math.floor(mean - _SPREAD * width - _SPREAD))
    d = np.arange(low, min(n_images, math.ceil(mean + _SPREAD * width + _SPREAD)) + 1)
    most = np.asarray(binom.ppf(level / 2, d, 0.5))  # may be one too many for the second
    most = most - (2 * np.asarray(binom.cdf(most, d, 0.5)) > level)
    passed = np.asarray(binom.cdf(most, d, only_second / differing))
    return min(1.0, float(np.asarray(binom.pmf(d, n_images, differing)) @ passed))


def images_needed(test: PairedTest, level: float = LEVEL) -> int | None:
    """How many images in all would show this difference, if it is real: a rough number.

    It takes the observed shares of differing images for the true ones and looks for a number of
    images, above the present one, from which the power reaches 80 %. As the power rises with small
    teeth, a slightly smaller number may do as well.

    Returns:
        At most `MAX_IMAGES`, which stands for "so many or more"; None if there is no difference
        to show.
    """
    if test.difference == 0:
        return None
    better, worse = sorted((test.n_only_first, test.n_only_second), reverse=True)
    shares = better / test.n_images, worse / test.n_images

    def enough(n_images: int) -> bool:
        return power(n_images, *shares, level) >= POWER

    too_few, many = test.n_images, test.n_images + 1
    while many < MAX_IMAGES and not enough(many):
        too_few, many = many, min(2 * many, MAX_IMAGES)
    while many - too_few > 1:  # enough(many), or many is the last to be told
        middle = (too_few + many) // 2
        too_few, many = (too_few, middle) if enough(middle) else (middle, many)
    return many


@dataclass(frozen=True, slots=True)
class Comparison:
    """One of several comparisons that are shown together.

    Attributes:
        first: name of the first recognizer.
        second: name of the second.
        test: the two on the same images.
        p_value: corrected by Holm for all comparisons shown.
        level: what the uncorrected p-value is held against, by Holm: 0.05 if this is the only one.
        n_comparisons: comparisons shown together, this one included.
        n_more: images that would have to be added to tell the difference from luck, if it is real;
            rough; None if it was told, or there is none.
    """

    first: str
    second: str
    test: PairedTest
    p_value: float
    level: float
    n_comparisons: int
    n_more: int | None

    @property
    def significant(self) -> bool:
        """Whether the difference is more than luck, with all comparisons considered."""
        return self.p_value <= LEVEL

    def sentence(self, images: str = "test images") -> str:
        """The comparison in plain words; `images`, in the plural, says what images these are."""
        n_images, difference = self.test.n_images, self.test.difference
        if n_images == 0:
            return f"Without {images}, nothing says whether {self.first} beats {self.second}."
        images = images.removesuffix("s") if n_images == 1 else images
        if self.test.n_differing == 0:
            return f"{self.first} and {self.second} recognize the same of the {n_images} {images}."
        if difference == 0:
            return (
                f"{self.first} recognizes as many of the {n_images} {images} as {self.second}; "
                f"each recognizes {self.test.n_only_first} that the other does not."
            )
        count = f"{abs(difference)} {'more' if difference > 0 else 'fewer'}"
        plural = "image" if abs(difference) == 1 else "images"
        luck = "is more than luck" if self.significant else "cannot be told from luck"
        return (
            f"{self.first} recognizes {count} {plural} than {self.second}; with {n_images} "
            f"{images} that {luck} ({self._p_in_words()}){self._more_in_words()}."
        )

    def _p_in_words(self) -> str:
        p = "p < 0.001" if self.p_value < 0.001 else f"p = {self.p_value:.2g}"
        n = self.n_comparisons
        return p if n == 1 else f"{p}, corrected for {n} comparisons"

    def _more_in_words(self) -> str:
        if self.n_more is None:
            return ""
        if self.test.n_images + self.n_more >= MAX_IMAGES:
            return f"; if the difference is real, it would take more than {MAX_IMAGES:,} to show it"
        return f"; if the difference is real, roughly {_roughly(self.n_more)} more would show it"


def compare(
    recognized: Mapping[str, NDArray[np.bool_]], pairs: Sequence[tuple[str, str]]
) -> tuple[Comparison, ...]:
    """Compare pairs of recognizers that are shown together, corrected for how many they are.

    Args:
        recognized: which images each recognizer recognizes, bool (n_images,), by name.
        pairs: names of the first and the second of each comparison.

    Returns:
        One comparison a pair, in their order.

    Raises:
        KeyError: if a pair names a recognizer that is not there.
        ValueError: if two are not of the same images.
    """
    tests = [mcnemar(recognized[first], recognized[second]) for first, second in pairs]
    p_values = [test.p_value for test in tests]
    factors = dict(_holm_factors(p_values))
    return tuple(
        _comparison(pair, test, p_value, LEVEL / factors[place], len(pairs))
        for place, (pair, test, p_value) in enumerate(
            zip(pairs, tests, holm(p_values), strict=True)
        )
    )


def _comparison(
    pair: tuple[str, str], test: PairedTest, p_value: float, level: float, n_comparisons: int
) -> Comparison:
    needed = None if p_value <= LEVEL else images_needed(test, level)
    return Comparison(
        first=pair[0],
        second=pair[1],
        test=test,
        p_value=p_value,
        level=level,
        n_comparisons=n_comparisons,
        n_more=None if needed is None else needed - test.n_images,
    )


def _holm_factors(p_values: Sequence[float]) -> list[tuple[int, int]]:
    """Place of each p-value, from the smallest up, and what Holm multiplies it by."""
    order = sorted(range(len(p_values)), key=lambda place: p_values[place])
    return [(place, len(order) - rank) for rank, place in enumerate(order)]


def _roughly(number: int) -> str:
    """Rounded up to 5, 10 or two digits, so that it neither looks exact nor promises too much."""
    step = 5 if number < 100 else max(10, 10 ** (len(str(number)) - 2))
    return f"{-(-number // step) * step:,}"
