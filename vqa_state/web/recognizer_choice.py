"""What the user takes along: all questions or the chosen ones, their vote, when asking ends."""

from dataclasses import dataclass, replace
from urllib.parse import urlencode

from vqa_state.errors import NothingToSearchError
from vqa_state.project.project import Project
from vqa_state.project.searches import Results
from vqa_state.recognizer.recognizer import Recognizer
from vqa_state.search.objectives import Objective
from vqa_state.study.assess import Assessment, assessment
from vqa_state.study.export import recognizer_with
from vqa_state.study.optimize import recognizer_path, results, unchosen_recognizer
from vqa_state.votes.rules import VoteKind
from vqa_state.web import arguments

__all__ = ["Taken", "found_and_assessed", "taken_from", "taken_recognizer"]


@dataclass(frozen=True, slots=True)
class Taken:
    """How a recognizer is taken; the first one is what the optimization itself writes.

    Attributes:
        vote: how answers are counted.
        coverage: share of images that shall get a verdict, in (0, 1); None abstains only at ties.
        stop_early: whether asking ends as soon as the rest cannot change the verdict.
        all_questions: whether all are asked, by the paper's vote; vote and coverage wait meanwhile.
    """

    vote: VoteKind = VoteKind.PAPER
    coverage: float | None = None
    stop_early: bool = False
    all_questions: bool = False

    @property
    def plain(self) -> bool:
        """Whether the recognizer is the one that the optimization wrote."""
        return not self.all_questions and self.vote is VoteKind.PAPER and self.coverage is None

    def query(self, *, asking: bool) -> str:
        """The choice as the end of an address; empty for the first choice."""
        fields: dict[str, str] = {}
        if self.all_questions:
            fields["all"] = "1"
        elif not self.plain:
            fields["vote"] = self.vote.value
            fields |= {} if self.coverage is None else {"coverage": f"{self.coverage:g}"}
        if asking and self.stop_early:
            fields["early"] = "1"
        return f"?{urlencode(fields)}" if fields else ""


def taken_from(
    vote: object, coverage: object, stop_early: object = False, all_questions: object = False
) -> Taken:
    """A choice from a page or an address; each argument may be anything.

    A coverage of 1 is none: every image gets a verdict, but for ties.

    Raises:
        RequestError: if an argument is none that a page sends.
    """
    kind = arguments.choice(vote, VoteKind, "the kind of vote")
    share = arguments.number(coverage, "the coverage")
    if not 0 < share <= 1:
        raise arguments.RequestError(f"the coverage must be above 0 and at most 1, got {share}")
    if not isinstance(stop_early, bool) or not isinstance(all_questions, bool):
        raise arguments.RequestError("stopping early and asking all must be yes or no")
    return Taken(kind, None if share == 1 else share, stop_early, all_questions)


def found_and_assessed(project: Project) -> tuple[Results | None, Assessment | None]:
    """The project's present results, and what is kept of their assessment."""
    found = results(project)
    return found, None if found is None else assessment(project, found)


def taken_recognizer(project: Project, objective: Objective, taken: Taken) -> Recognizer:
    """The recognizer for an objective, with the vote and coverage that were taken; or of all.

    Raises:
        RecognizerError: if none was written.
        NothingToSearchError: if the choice needs an assessment that is not there, or is stale.
    """
    if taken.plain:
        return Recognizer.load(recognizer_path(project, objective))
    project = replace(project, chosen=objective)
    found, assessed = found_and_assessed(project)
    if found is None:
        raise NothingToSearchError("images, labels or questions changed; optimize again")
    if taken.all_questions:
        return unchosen_recognizer(project, found)
    if assessed is None:
        raise NothingToSearchError(
            f"{objective.value} is not assessed for these answers; press Assess on Results first"
        )
    return recognizer_with(project, found, assessed, taken.vote, taken.coverage)
