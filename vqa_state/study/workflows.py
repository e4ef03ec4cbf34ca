"""Asking, optimizing and assessing as runs: what a program or a notebook calls."""

from collections.abc import Callable, Iterator

from vqa_state.evaluation.out_of_bag import N_RESAMPLES
from vqa_state.models import VQAModel
from vqa_state.project.project import Project
from vqa_state.study import assess as assessing
from vqa_state.study import collect
from vqa_state.study import optimize as optimizing
from vqa_state.study.assess import AssessProgress
from vqa_state.study.collect import AskProgress
from vqa_state.study.features import Featurizer, embedded_features
from vqa_state.study.optimize import OptimizeProgress
from vqa_state.study.progress_bar import Position
from vqa_state.study.run import Run, Stop, never

__all__ = [
    "ask",
    "asking_position",
    "assess",
    "assessing_position",
    "optimize",
    "optimizing_position",
]


def ask(project: Project, model: VQAModel, *, stop: Stop = never) -> Run[AskProgress]:
    """Ask the model every question about every copy of every labelled image.

        last = ask(project, load_model("embedded")).run()
        print(last.n_asked, last.n_failed)

    The project becomes that model's: its name and fingerprint are kept in it, and it is saved when
    the run begins. Answers that are stored already are not asked again.

    Args:
        project: its labelled train and test images are asked about; see `Project.assign_splits`.
        model: from `load_model`, or any object that keeps `vqa_state.models.VQAModel`.
        stop: a second way to stop; see `Run`.

    Returns:
        A run of reports: `n_calls` of the whole table, `n_stored`, `n_asked`, `n_failed` and
            `seconds`.

    Raises:
        NothingToSearchError: once it runs, if no image is labelled.
        ProjectError: once it runs, if there is no question, the project cannot be saved, or another
            program asks about it now.
        StoreError: once it runs, if an answer cannot be stored.
    """

    def work(stopped: Stop) -> Iterator[AskProgress]:
        project.model, project.fingerprint = model.name, model.fingerprint
        project.save()
        yield from collect.ask(project, model, stopped)

    return Run("asking", work, asking_position, stop)


def optimize(
    project: Project, *, prove: bool = True, incomplete: bool = False, stop: Stop = never
) -> Run[OptimizeProgress]:
    """Choose the questions whose vote recognizes the most training images.

        last = optimize(project).run()
        print({objective.value: report.subset for objective, report in last.reports.items()})

    Searches for all four objectives, and writes searches and recognizers into the project's folder.

    Args:
        project: its engine, search settings, weights and search seed are used.
        prove: False leaves out how good the subsets are at most.
        incomplete: True searches on the training images that have all their answers where others
            lack some; such a recognizer says so, and the test stays closed.
        stop: a second way to stop; see `Run`.

    Returns:
        A run of reports: the generation, the best subset and its terms for each objective.

    Raises:
        MissingAnswersError: once it runs, if training images lack answers; see `incomplete`.
        NothingToSearchError: once it runs, if there is no training image of one of the states.
        MissingExtraError: once it runs, if the packages of the extra `search` are not installed.
        ProjectError: once it runs, if there is no question, or a file cannot be written.
    """

    def work(stopped: Stop) -> Iterator[OptimizeProgress]:
        yield from optimizing.optimize(project, stopped, prove=prove, incomplete=incomplete)

    return Run("searching", work, optimizing_position, stop)


def assess(
    project: Project,
    *,
    features: Callable[[], Featurizer] = embedded_features,
    n_resamples: int = N_RESAMPLES,
    stop: Stop = never,
) -> Run[AssessProgress]:
    """Estimate how good the recognizer is on new images, and what else could be taken.

        assessment = assess(project).run().assessment
        print(assessment.recommended_estimate.share)

    Args:
        project: with searches that fit its present answers and labels.
        features: makes what the linear probe looks with; called when it is its turn.
        n_resamples: bootstrap resamples of the out-of-bag estimate, at least 1.
        stop: a second way to stop; see `Run`.

    Returns:
        A run of reports: stage, `n_done` of `n_total` steps; the last one holds the assessment.

    Raises:
        NothingToSearchError: once it runs, if nothing was searched for the present answers, or a
            state has fewer than two training images.
        ProjectError: once it runs, if a file cannot be written.
    """

    def work(stopped: Stop) -> Iterator[AssessProgress]:
        yield from assessing.assess(project, stopped, features=features, n_resamples=n_resamples)

    return Run("assessing", work, assessing_position, stop)


def asking_position(report: AskProgress) -> Position:
    """Calls done, with what came from the store, what failed, and the time left."""
    notes = [f"{report.n_stored:,} from the store"] if report.n_stored else []
    notes += [f"{report.n_failed:,} failed"] if report.n_failed else []
    notes += [f"{report.n_cut_off:,} cut off"] if report.n_cut_off else []
    if report.seconds_left is not None:  # by calls paid for, not by those from the store
        notes.append(f"about {report.seconds_left:.0f} s left")
    return Position(report.n_calls - report.n_left, report.n_calls, " · ".join(notes))


def optimizing_position(report: OptimizeProgress) -> Position:
    """Generations done, with images recognized for each objective, or what is proved of it."""
    if report.proving:
        terms = [f"{one.value} {proof.sentence}" for one, proof in report.proofs.items()]
    else:
        terms = [
            f"{one.value} {found.terms.n_recognized}/{found.terms.n_images}"
            for one, found in report.reports.items()
        ]
    return Position(report.generation, report.total, " · ".join(terms))


def assessing_position(report: AssessProgress) -> Position:
    """Steps of this stage."""
    return Position(report.n_done, report.n_total, report.stage.value)
