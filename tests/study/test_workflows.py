"""Asking, optimizing, assessing and exporting as a program calls them."""

import pytest

from vqa_state import ask, assess, errors, export, optimize
from vqa_state.answers.answer import Answer
from vqa_state.errors import MissingExtraError, NothingToSearchError, ProjectError
from vqa_state.project.project import Project
from vqa_state.search.genetic import SearchSettings
from vqa_state.testing import ScriptedModel

SMALL = SearchSettings(population=20, generations=3)


def by_brightness(image, question):
    """Says yes to "open" about brighter pictures, to "closed" about darker ones."""
    bright = image.convert("L").resize((1, 1)).getpixel((0, 0)) > 127
    return Answer("yes" if bright == ("open" in question) else "no", 0.9)


@pytest.fixture
def asked(project):
    project.search = SMALL
    ask(project, ScriptedModel(by_brightness, fingerprint="bright/1")).run()
    return project


def test_asking_keeps_the_model_in_the_project_and_saves_it(project, scripted):
    project.seed = 7
    last = ask(project, scripted).run()
    assert last.n_left == last.n_failed == 0
    kept = Project.open(project.folder)
    assert (kept.model, kept.fingerprint, kept.seed) == ("scripted", "scripted/1", 7)


def test_nothing_is_kept_before_it_runs(project, scripted):
    ask(project, scripted)
    assert project.fingerprint is None


def test_asking_again_asks_nothing(asked):
    assert ask(asked, ScriptedModel(by_brightness, fingerprint="bright/1")).run().n_asked == 0


def test_a_loop_that_is_left_frees_the_project(project, scripted):
    for _ in ask(project, scripted):
        break
    assert ask(project, scripted).run().n_left == 0


def test_a_stop_keeps_what_came_and_the_next_run_goes_on(project, scripted):
    run = ask(project, scripted)
    reports = iter(run)
    next(reports)
    run.stop()
    *_, last = reports
    assert last.stopped
    again = ask(project, scripted).run()
    assert again.n_stored == last.n_asked
    assert again.n_left == 0


def test_two_runs_at_once_are_refused(project, scripted):
    reports = iter(ask(project, scripted))
    next(reports)
    with pytest.raises(ProjectError, match="asked by another"):
        ask(project, scripted).run()


def test_the_road(asked):
    last = optimize(asked, prove=False).run()
    assert last.searched
    recognizer = export(asked)
    assert recognizer.model.fingerprint == "bright/1"
    asked.all_questions = True
    assert len(export(asked).questions) == 16


def test_a_project_that_was_not_optimized_has_no_recognizer(asked):
    with pytest.raises(NothingToSearchError, match="optimize first"):
        export(asked)


def test_assessing_needs_a_search_and_says_so(asked):
    with pytest.raises(NothingToSearchError, match="optimize"):
        assess(asked).run()


def test_without_the_solver_optimizing_names_the_extra(asked, monkeypatch):
    monkeypatch.setattr(errors, "find_spec", lambda package: None)
    with pytest.raises(MissingExtraError, match=r"'ortools'.*pip install 'vqa-state\[search\]'"):
        optimize(asked).run()
    optimize(asked, prove=False).run()  # needs none
