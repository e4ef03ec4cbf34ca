"""A stop is heard within a second, at sizes where the work takes far longer."""

import time

import pytest
from search_tables import draw_counts

from vqa_state.search.background_task import BackgroundTask, StopPoll
from vqa_state.search.cpsat import best_value
from vqa_state.search.exact import enumerate_subsets
from vqa_state.search.objectives import Objective
from vqa_state.search.proof import Badge, prove


class Later:
    """A stop that comes after some seconds, and knows how long it was not heard."""

    def __init__(self, seconds):
        self._at = time.monotonic() + seconds

    def __call__(self):
        return time.monotonic() > self._at

    @property
    def unheard(self):
        return time.monotonic() - self._at


def test_the_comparison_hears_it_while_it_counts():
    """24 questions and 800 images are some ten seconds of counting."""
    stop = Later(0.5)
    reports = list(
        enumerate_subsets(draw_counts(0, 800, 24, p_invalid=0.1), Objective.S_PLUS, stop=stop)
    )
    assert stop.unheard < 1
    assert not reports[-1].finished
    assert reports[-1].n_most == 800  # nothing is known yet, and no subset recognizes more


def test_news_without_end_does_not_drown_it():
    def talk(put):
        for _ in range(150):
            put(1)
            time.sleep(0.02)

    stop = Later(0.3)
    work = BackgroundTask(talk, stop)
    for _ in work:
        pass
    assert work.stopped
    assert stop.unheard < 1


def test_an_asker_asks_by_the_clock():
    asked = []
    is_stopped = StopPoll(lambda: asked.append(1) or len(asked) > 1)
    assert not any(is_stopped() for _ in range(1000))
    assert len(asked) == 1
    time.sleep(0.15)
    assert is_stopped()
    assert is_stopped()
    assert len(asked) == 2  # what was told once is not asked again


def test_building_a_large_model_hears_it():
    counts, stop = draw_counts(1, 80, 1000), Later(0.5)
    reports = list(
        best_value(
            counts, Objective.S_PLUS, (0,), n_recognized=(0, 80), deterministic_time=6, stop=stop
        )
    )
    assert reports[-1].stopped
    assert stop.unheard < 1


@pytest.mark.parametrize("objective", [Objective.S_PLUS, Objective.S_PRIME_MINUS])
def test_a_large_proof_hears_it(objective):
    counts, stop = draw_counts(2, 300, 400, 6), Later(1)
    *_, report = prove(counts, objective, (0,), stop=stop)
    assert stop.unheard < 1
    assert report.stopped
    assert report.badge is Badge.FOUND
