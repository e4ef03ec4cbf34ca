"""Questions with the same answers are interchangeable: one class, of which some number is chosen.

A proof looks at numbers of each class instead of at single questions, so it has less to look at.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vqa_state.answers.rates import Counts
from vqa_state.search.objectives import Objective

__all__ = ["QuestionClasses", "question_classes"]

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class QuestionClasses:
    """The questions of a table, as an objective sees them.

    Attributes:
        correct: Correct answers to one question of each class, (n_images, n_classes).
        asked: answers that stand in the denominator of the rate; same shape.
        members: positions of each class's questions, ascending.
        n_questions: questions in all.
    """

    correct: Integers
    asked: Integers
    members: tuple[tuple[int, ...], ...]
    n_questions: int

    @property
    def n_images(self) -> int:
        """Number of rows."""
        return len(self.correct)

    @property
    def margins(self) -> Integers:
        """An image is recognized if its margins add up to more than 0; (n_images, n_classes)."""
        return 2 * self.correct - self.asked

    @property
    def sizes(self) -> Integers:
        """Questions in each class, (n_classes,)."""
        return np.array([len(members) for members in self.members], dtype=np.int64)

    @property
    def n_subsets(self) -> int:
        """Subsets that differ in their answers, the empty one among them."""
        total = 1
        for members in self.members:
            total *= len(members) + 1
        return total

    def subset(self, numbers: Sequence[int]) -> tuple[int, ...]:
        """The positions of so many questions of each class, ascending.

        Of a class the last questions are taken: that is the lexicographically smallest vector.
        """
        pairs = zip(self.members, numbers, strict=True)
        return tuple(sorted(p for members, n in pairs for p in members[len(members) - n :]))

    def numbers(self, subset: Sequence[int]) -> Integers:
        """How many questions of each class stand in a subset, (n_classes,)."""
        chosen = set(subset)
        return np.array([len(chosen & set(members)) for members in self.members], dtype=np.int64)


def question_classes(counts: Counts, objective: Objective) -> QuestionClasses:
    """Group the questions whose Correct and asked answers agree on every image."""
    asked = objective.kind.asked(counts)
    classes: dict[bytes, list[int]] = {}
    for position in range(counts.n_questions):
        column = counts.correct[:, position].tobytes() + asked[:, position].tobytes()
        classes.setdefault(column, []).append(position)
    members = tuple(tuple(positions) for positions in classes.values())
    first = [positions[0] for positions in members]
    return QuestionClasses(counts.correct[:, first], asked[:, first], members, counts.n_questions)
