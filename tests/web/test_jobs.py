"""Jobs: stop, attach, failure, double start. Nothing sleeps; events say when to go on."""

import threading
from collections.abc import Iterator

import pytest

from vqa_state.errors import ModelError
from vqa_state.web.jobs import BusyError, Job, Jobs, JobState, StopFlag


class Counter:
    """Work that counts until it is stopped, one number each time it is let through."""

    def __init__(self) -> None:
        self.gate = threading.Semaphore(0)
        self.runs = 0

    def __call__(self, stop: StopFlag) -> Iterator[int]:
        self.runs += 1
        number = 0
        while not stop():
            if self.gate.acquire(timeout=0.01):
                number += 1
                yield number


def wait_for(job: Job, report: object) -> None:
    snapshot = job.snapshot
    while snapshot.report != report:
        before = snapshot.version
        snapshot = job.wait_change(before, timeout=5)
        assert snapshot.version != before, f"no change after {snapshot}"


def test_a_job_reports_and_ends_by_itself() -> None:
    job = Jobs().start("p", "ask", lambda _stop: iter([1, 2, 3]))
    snapshot = job.join(5)
    assert (snapshot.state, snapshot.report, snapshot.failure) == (JobState.DONE, 3, "")


def test_a_stop_is_seen_at_once_and_keeps_the_last_report() -> None:
    work = Counter()
    job = Jobs().start("p", "ask", work)
    work.gate.release()
    wait_for(job, 1)
    job.stop()
    assert job.snapshot.state in (JobState.STOPPING, JobState.STOPPED)
    assert job.join(1).state is JobState.STOPPED
    assert job.snapshot.report == 1


def test_stopping_a_finished_job_changes_nothing() -> None:
    job = Jobs().start("p", "ask", lambda _stop: iter([1]))
    done = job.join(5)
    job.stop()
    assert job.snapshot == done


def test_a_second_start_attaches_to_the_running_job() -> None:
    jobs, work = Jobs(), Counter()
    first = jobs.start("p", "ask", work)
    assert jobs.start("p", "ask", work) is first
    assert jobs.get("p", "ask") is first
    first.stop()
    first.join(1)
    assert work.runs == 1


def test_a_finished_job_makes_room_for_a_new_one() -> None:
    jobs = Jobs()
    first = jobs.start("p", "ask", lambda _stop: iter(()))
    first.join(5)
    assert jobs.alive("p") is None
    assert jobs.start("p", "ask", lambda _stop: iter(())) is not first


def test_one_project_does_one_kind_of_work_at_a_time() -> None:
    jobs, work = Jobs(), Counter()
    job = jobs.start("p", "ask", work)
    with pytest.raises(BusyError, match=r"busy \(ask\)"):
        jobs.start("p", "optimize", work)
    other = jobs.start("another", "optimize", work)
    for one in (job, other):
        one.stop()
        assert one.join(1).state is JobState.STOPPED


def test_a_known_failure_is_its_own_sentence() -> None:
    def work(_stop: StopFlag) -> Iterator[int]:
        yield 1
        raise ModelError("the weights are missing; download them")

    snapshot = Jobs().start("p", "ask", work).join(5)
    assert snapshot.state is JobState.FAILED
    assert snapshot.failure == "the weights are missing; download them"
    assert snapshot.report == 1


def test_an_unknown_failure_is_a_sentence_and_the_terminal_gets_the_traceback(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def work(_stop: StopFlag) -> Iterator[int]:
        yield 1 // 0

    snapshot = Jobs().start("p", "ask", work).join(5)
    assert snapshot.state is JobState.FAILED
    assert "ZeroDivisionError" in snapshot.failure
    assert "Traceback" in capsys.readouterr().err


def test_a_watcher_wakes_up_with_the_change() -> None:
    work = Counter()
    job = Jobs().start("p", "ask", work)
    seen = job.snapshot.version
    woken: list[object] = []
    watcher = threading.Thread(target=lambda: woken.append(job.wait_change(seen, 5).report))
    watcher.start()
    work.gate.release()
    watcher.join(5)
    assert woken == [1]
    job.stop()
    job.join(1)
