"""The stored answers about both sides of a project, and whether they are enough to go on."""

from dataclasses import dataclass

from vqa_state.answers.completeness import Completeness, SideAnswers
from vqa_state.answers.table import AnswerTable
from vqa_state.errors import MissingAnswersError, NothingToSearchError
from vqa_state.project.project import Project
from vqa_state.project.split import Split
from vqa_state.study.collect import answer_table

__all__ = ["SideTables", "read_tables", "require_answers"]


@dataclass(frozen=True, slots=True, eq=False)
class SideTables:
    """Answers about all labelled images of each side, complete or not.

    Attributes:
        train: about the training images.
        test: about the test images, to the same questions; it may have no image.
        answers: how far both are complete.
    """

    train: AnswerTable
    test: AnswerTable
    answers: Completeness

    @property
    def seen(self) -> AnswerTable:
        """The complete training images: all that a search may see."""
        return self.train.take(self.train.complete)

    @property
    def opened(self) -> AnswerTable | None:
        """The test images; None without any, and while an answer on either side is missing."""
        return self.test if self.answers.whole and self.test.n_images else None

    def require_training(self, *, incomplete: bool) -> None:
        """Do nothing if a search may begin.

        Args:
            incomplete: whether somebody said that the complete training images are enough.

        Raises:
            MissingAnswersError: if training images lack answers and nobody said so, or if those
                that are complete do not show both states.
            NothingToSearchError: if there is no training image.
        """
        train = self.answers.train
        if not train.n_complete:
            error = MissingAnswersError if train.n_images else NothingToSearchError
            raise error(
                "no training image has all its answers yet; ask the model (again), then optimize"
            )
        if train.whole:
            return
        if not self.answers.part_is_searchable:
            raise MissingAnswersError(
                f"{train.lacks}, and the complete ones are all of one state; ask the model for the "
                "missing answers, then optimize"
            )
        if not incomplete:
            raise MissingAnswersError(
                f"{train.lacks}; ask the model for them, then optimize. To search on the "
                f"{train.n_complete} complete ones only, say so: --incomplete on the command line, "
                "incomplete=True in a program, the second button on the tab Optimize. Such a "
                "search never opens the test"
            )


def read_tables(project: Project) -> SideTables:
    """The stored answers of the project's model. No model is loaded.

    Raises:
        NothingToSearchError: if the model was never asked.
        ProjectError: if there is no question.
        StoreError: if the store cannot be read.
    """
    train, test = (answer_table(project, split) for split in (Split.TRAIN, Split.TEST))
    answers = Completeness(SideAnswers.of("training", train), SideAnswers.of("test", test))
    return SideTables(train, test, answers)


def require_answers(project: Project, last_failure: str | None, go_on: str) -> None:
    """Do nothing if every answer on both sides is there; so work that asks and then searches ends.

    Args:
        project: after it was asked.
        last_failure: why the last failed call failed, if one did.
        go_on: what to do next, as the end of a sentence.

    Raises:
        MissingAnswersError: if one is missing; it says how many of which images, and why.
    """
    answers = read_tables(project).answers
    if not answers.whole:
        why = f" (the last failure: {last_failure})" if last_failure else ""
        raise MissingAnswersError(
            f"{answers.lacks}{why}. Nothing was searched; what was answered is kept. {go_on}"
        )
