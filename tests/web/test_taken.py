"""What is taken along of what Results shows: which questions, whose vote, when asking ends."""

from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient
from web.test_trust import STRANGE, assessed, client, quick

from vqa_state.project.split import Split
from vqa_state.study.build_recognizer import unchosen_recognizer
from vqa_state.study.export import recognizer_with
from vqa_state.votes.rules import VoteKind
from vqa_state.web.arguments import RequestError
from vqa_state.web.recognizer_choice import Taken, found_and_assessed, taken_from
from vqa_state.web.session import Desk
from vqa_state.web.tabs.recognizer import tab as recognizer
from vqa_state.web.tabs.results import leaderboard

__all__ = ["assessed", "client", "quick"]  # fixtures of the other file


def test_the_recommended_vote_is_taken_only_when_asked(desk: Desk, assessed: str) -> None:
    _, kept = found_and_assessed(desk.snapshot(assessed))
    assert kept is not None
    assert desk.taken(assessed) == Taken()
    recognizer.take_coverage(desk, assessed, 0.8)
    recognizer.take_early(desk, assessed, True)
    leaderboard.use(desk, assessed)
    assert desk.taken(assessed) == Taken(kept.recommendation.kind, 0.8, True)
    assert Desk(desk.root).taken(assessed) == Taken(kept.recommendation.kind, 0.8)  # restarted
    radio, slider, early = recognizer.votes(desk, assessed)
    assert (radio.value, slider.value, early) == (kept.recommendation.kind.value, 0.8, True)
    assert [value for _, value in radio.choices] == [kind.value for kind in kept.votes]


def took(desk: Desk, pid: str, vote: Any, coverage: Any, early: Any) -> Any:
    """One field after the other; what the tab then shows below its fields."""
    recognizer.take_vote(desk, pid, vote)
    recognizer.take_coverage(desk, pid, coverage)
    return recognizer.take_early(desk, pid, early)[1:]


def test_a_field_that_changes_leaves_what_another_window_chose(desk: Desk, assessed: str) -> None:
    recognizer.take_vote(desk, assessed, "threshold")
    recognizer.take_coverage(desk, assessed, 0.9)
    assert recognizer.take_early(desk, assessed, True)[0] == "s+"
    assert desk.taken(assessed) == Taken(VoteKind.THRESHOLD, 0.9, True)
    recognizer.choose(desk, assessed, "all")
    assert recognizer.take_vote(desk, assessed, "paper")[0] == "all"
    recognizer.choose(desk, assessed, "s+")
    assert desk.taken(assessed) == Taken(VoteKind.THRESHOLD, 0.9, True)


@pytest.mark.parametrize("vote", [VoteKind.PAPER, VoteKind.THRESHOLD, VoteKind.WEIGHTED_ANSWERS])
@pytest.mark.parametrize("coverage", [1, 0.5])
def test_the_download_is_what_was_taken(
    client: TestClient, desk: Desk, assessed: str, vote: VoteKind, coverage: float
) -> None:
    about, link, place = took(desk, assessed, vote.value, coverage, True)
    project = desk.snapshot(assessed)
    found, kept = found_and_assessed(project)
    assert found is not None
    plain = vote is VoteKind.PAPER and coverage == 1  # as written by the optimization
    share = None if coverage == 1 else coverage
    wanted = recognizer_with(project, found, None if plain else kept, vote, share)
    assert client.get(link["link"]["href"]).content == wanted.to_bytes()
    assert ("unknown" in about["text"]) == (coverage != 1)
    image = project.labelled(Split.TEST)[0]
    verdict = client.post(
        f"/projects/{assessed}/recognize/s+{place['query']}", content=project.read(image)
    ).json()
    all_calls = wanted.calls_per_image
    assert verdict["n_calls"] + verdict["n_skipped"] == all_calls
    seen = recognizer.see(desk, assessed, "s+", np.zeros((48, 64, 3), np.uint8))["verdict"]
    assert seen["n_calls"] + seen["n_skipped"] == all_calls


def test_all_questions_can_be_taken_instead_of_the_chosen_ones(
    client: TestClient, desk: Desk, assessed: str
) -> None:
    kind = VoteKind.THRESHOLD.value
    took(desk, assessed, kind, 0.5, False)
    about, link, place = recognizer.choose(desk, assessed, "all")
    project = desk.snapshot(assessed)
    found, _ = found_and_assessed(project)
    assert found is not None
    wanted = unchosen_recognizer(project, found)
    answered = client.get(link["link"]["href"])
    assert answered.content == wanted.to_bytes()
    assert "all_questions.json" in answered.headers["content-disposition"]
    assert "none of which chose its questions" in about["text"]
    image = project.labelled(Split.TEST)[0]
    verdict = client.post(
        f"/projects/{assessed}/recognize/s+{place['query']}", content=project.read(image)
    ).json()
    assert verdict["n_calls"] == wanted.calls_per_image
    assert took(desk, assessed, "paper", 1, False)[1] == link  # of another window: they wait
    frame = np.zeros((48, 64, 3), np.uint8)
    seen = recognizer.see(desk, assessed, "all", frame)["verdict"]
    assert seen["n_calls"] == wanted.calls_per_image
    chosen = recognizer.see(desk, assessed, "s+", frame)["verdict"]  # of a page that shows it
    assert chosen["n_calls"] < wanted.calls_per_image
    restarted = Desk(desk.root)
    assert recognizer.show(restarted, assessed)[0] == "all"
    radio, slider, _ = recognizer.votes(restarted, assessed)
    assert (radio.interactive, slider.interactive) == (False, False)
    assert (radio.value, slider.value) == (kind, 0.5)


@pytest.mark.parametrize("end", ["choose", "use"])
def test_a_choice_ends_asking_all(desk: Desk, assessed: str, end: str) -> None:
    recognizer.choose(desk, assessed, "all")
    if end == "choose":
        recognizer.choose(desk, assessed, "s-")
    else:
        assert "no longer all" in leaderboard.use(desk, assessed)["text"]
        assert "no longer all" not in leaderboard.use(desk, assessed)["text"]
    assert not desk.taken(assessed).all_questions
    assert recognizer.votes(desk, assessed)[0].interactive


def test_what_is_not_assessed_cannot_be_taken_along(desk: Desk, assessed: str) -> None:
    took(desk, assessed, VoteKind.THRESHOLD.value, 1, False)
    about, link, place = recognizer.choose(desk, assessed, "s-")
    assert "Assess" in about["text"]
    assert "link" not in link
    assert place == {}


@pytest.mark.parametrize("strange", STRANGE)
def test_strange_choices_change_nothing(desk: Desk, assessed: str, strange: Any) -> None:
    for fields in ((strange, 1, False), ("paper", strange, False), ("paper", 1, strange)):
        if fields == ("paper", 1, True):
            continue
        with pytest.raises(RequestError):
            took(desk, assessed, *fields)
    assert desk.taken(assessed) == Taken()


@pytest.mark.parametrize(
    "query",
    [
        "vote=x",
        "coverage=0",
        "coverage=nan",
        "coverage=x",
        "coverage=2",
        "all=2",
        "coverage=x&all=1",
        "vote=../x&coverage=1",
    ],
)
def test_strange_queries_are_refused(client: TestClient, assessed: str, query: str) -> None:
    assert client.get(f"/projects/{assessed}/recognizers/s+.json?{query}").status_code == 404
    url = f"/projects/{assessed}/recognize/s+?{query}"
    assert client.post(url, content=b"x").status_code == 400


def test_an_address_leads_back_to_the_choice() -> None:
    taken = taken_from("weighted answers", 0.75, True)
    assert taken.query(asking=True) == "?vote=weighted+answers&coverage=0.75&early=1"
    assert taken.query(asking=False) == "?vote=weighted+answers&coverage=0.75"
    assert taken_from("paper", 1).query(asking=True) == ""
    everything = taken_from("threshold", 0.75, True, True)
    assert everything.query(asking=True) == "?all=1&early=1"
    assert everything.query(asking=False) == "?all=1"
