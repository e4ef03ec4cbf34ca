"""Long work that belongs to the server, not to a browser tab: start, watch, stop, re-attach.

A job eats a generator of frozen progress reports in a thread of its own and keeps the latest one.
Pages only watch, so a reload, a second tab or a lost connection never ends the work.
"""

import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from vqa_state.errors import VQAStateError

__all__ = ["BusyError", "Job", "JobState", "Jobs", "Snapshot", "StopFlag", "Work"]


class JobState(StrEnum):
    """How far a job is; the last three are final."""

    RUNNING = "running"
    STOPPING = "stopping"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"

    @property
    def alive(self) -> bool:
        """Whether the job's thread is still at work."""
        return self in (JobState.RUNNING, JobState.STOPPING)


class BusyError(VQAStateError):
    """Another kind of work is running on the same project."""


class StopFlag:
    """Says whether somebody asked the work to stop; call it often."""

    def __init__(self) -> None:
        self._event = threading.Event()

    def __call__(self) -> bool:
        """Whether the work should stop now."""
        return self._event.is_set()

    def set(self) -> None:
        """Ask the work to stop."""
        self._event.set()


Work = Callable[[StopFlag], Iterator[Any]]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What a page shows of a job; `version` grows with every change."""

    state: JobState
    version: int = 0
    report: Any = None
    failure: str = ""


class Job:
    """One run of one piece of work."""

    def __init__(self, kind: str, work: Work) -> None:
        self.kind = kind
        self._work = work
        self._stop = StopFlag()
        self._changed = threading.Condition()
        self._snapshot = Snapshot(JobState.RUNNING)
        self._thread = threading.Thread(target=self._run, name=f"job-{kind}", daemon=True)

    @property
    def snapshot(self) -> Snapshot:
        """The latest state; frozen, so it may be read without a lock."""
        return self._snapshot

    def start(self) -> None:
        """Let the work begin."""
        self._thread.start()

    def stop(self) -> None:
        """Ask for a stop. Watchers see it at once; the work ends when it looks at its flag."""
        self._stop.set()
        with self._changed:
            if self._snapshot.state is JobState.RUNNING:
                self._change(state=JobState.STOPPING)

    def wait_change(self, seen: int, timeout: float | None = 1.0) -> Snapshot:
        """Wait until the version differs from `seen`, at most `timeout` seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._snapshot.version != seen, timeout)
            return self._snapshot

    def join(self, timeout: float | None = None) -> Snapshot:
        """Wait for the end of the work, at most `timeout` seconds."""
        self._thread.join(timeout)
        return self._snapshot

    def _run(self) -> None:
        try:
            for report in self._work(self._stop):
                self._publish(report=report)
        except VQAStateError as error:
            self._publish(state=JobState.FAILED, failure=str(error))
        except Exception as error:  # noqa: BLE001 - the thread's edge: nobody above can show it
            traceback.print_exc(file=sys.stderr)
            sentence = f"{type(error).__name__}: {error}; the terminal shows where"
            self._publish(state=JobState.FAILED, failure=sentence)
        else:
            self._publish(state=JobState.STOPPED if self._stop() else JobState.DONE)

    def _publish(self, **fields: Any) -> None:
        with self._changed:
            self._change(**fields)

    def _change(self, **fields: Any) -> None:
        self._snapshot = replace(self._snapshot, version=self._snapshot.version + 1, **fields)
        self._changed.notify_all()


class Jobs:
    """The jobs of all projects: at most one is alive a project, the last of each kind is kept."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._jobs: dict[tuple[str, str], Job] = {}

    def get(self, project: str, kind: str) -> Job | None:
        """The last job of that kind, or None."""
        return self._jobs.get((project, kind))

    def alive(self, project: str) -> Job | None:
        """The job that works on the project now, or None."""
        with self._lock:
            return self._alive(project)

    def start(self, project: str, kind: str, work: Work) -> Job:
        """Start `work`, or attach to the job of the same kind that is already running.

        Raises:
            BusyError: if another kind of work is running on the project.
        """
        with self._lock:
            running = self._alive(project)
            if running is not None and running.kind == kind:
                return running
            if running is not None:
                raise BusyError(
                    f"this project is busy ({running.kind}); wait until it ends, or stop it first"
                )
            job = self._jobs[project, kind] = Job(kind, work)
            job.start()
            return job

    def _alive(self, project: str) -> Job | None:
        mine = (job for (owner, _), job in self._jobs.items() if owner == project)
        return next((job for job in mine if job.snapshot.state.alive), None)
