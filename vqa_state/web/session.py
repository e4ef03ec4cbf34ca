"""The desk: which projects there are, which are open, and what works on them.

One `Project` object a folder, one lock a project: every change is made under its lock and saved
before the lock opens again. A folder that another program changed meanwhile is read anew.
"""

import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from vqa_state.errors import ProjectError
from vqa_state.models import VQAModel
from vqa_state.models.capability_cache import known_as
from vqa_state.project.project import Project, StateNames
from vqa_state.project.schema import parse_project
from vqa_state.questions.grid import QuestionGrid, Wording, phrases_for
from vqa_state.study.vision_check import ModelCheck, recalled
from vqa_state.web.jobs import Jobs
from vqa_state.web.model_cache import Shelf
from vqa_state.web.model_notes import Telling
from vqa_state.web.recognizer_choice import Taken

__all__ = ["Desk"]


@dataclass
class _Open:
    """An open project and its lock; None until it is read, and after a change that failed."""

    lock: threading.RLock = field(default_factory=threading.RLock)
    project: Project | None = None


class Desk:
    """All that the pages share. Its methods may be called from any thread."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.jobs = Jobs()
        self._lock = threading.Lock()
        self._open: dict[str, _Open] = {}
        self._shelf = Shelf()
        self.telling = Telling()
        self._checks: dict[str, ModelCheck] = {}
        self._early: set[str] = set()
        self._names: dict[str, tuple[tuple[int, ...], str]] = {}

    def listing(self) -> dict[str, str]:
        """Id and name of every project, by name. A damaged one goes by the name of its folder.

        The names come from the files, so that no page waits for a project that is busy.
        """
        found = {path.parent.name: path.parent for path in self.root.glob("*/project.json")}
        names = {pid: self._name(pid) for pid in found if not pid.startswith(".")}
        return dict(sorted(names.items(), key=lambda item: (item[1].casefold(), item[0])))

    def create(self, name: str, positive: str, negative: str) -> str:
        """Make a project whose grid asks about `name`; return its id, which no user typed."""
        states = StateNames(positive, negative)
        wording, pid = Wording(name), uuid.uuid4().hex[:12]
        project = Project.create(self.root / pid, name, states)
        project.grid = QuestionGrid((wording,), phrases_for(states.positive, states.negative))
        project.save()
        return pid

    @contextmanager
    def reading(self, pid: object) -> Iterator[Project]:
        """The project with this id, for as long as nobody else may change it.

        Raises:
            ProjectError: if there is no such project, or it cannot be read.
        """
        entry = self._entry(pid)
        with entry.lock:
            if entry.project is None or entry.project.changed_elsewhere():
                entry.project = Project.open(self.root / str(pid))
            yield entry.project

    @contextmanager
    def changing(self, pid: object) -> Iterator[Project]:
        """Like `reading`, and saved at the end; after an error the file is read anew."""
        with self.reading(pid) as project:
            try:
                yield project
                project.save()
            except BaseException:
                self._entry(pid).project = None
                raise

    def snapshot(self, pid: object) -> Project:
        """A copy for long work: it sees nothing of later changes, and must not be saved."""
        with self.reading(pid) as project:
            return replace(project, images=dict(project.images))

    def model(self, name: str) -> VQAModel:
        """The model with this name; it takes the place of the one before.

        Raises:
            UnknownModelError: if the registry has no such name.
            NotApprovedError: if the user never said yes to it, or took the yes back.
            ModelError: if it cannot be loaded.
        """
        return self._shelf.get(name)

    def loaded(self, name: str) -> VQAModel | None:
        """The model if it is in memory already; nothing is loaded."""
        return self._shelf.loaded(name)

    def check(self, name: str) -> ModelCheck | None:
        """What was found of a model, since the app was started or earlier on this machine."""
        return self._checks.get(name) or recalled(name)

    def fingerprint(self, project: Project, name: str) -> str:
        """Of the model called `name`, as far as it is known without loading it; else ""."""
        loaded, known = self.loaded(name), known_as(name)
        if loaded is not None:
            return loaded.fingerprint
        if name == project.model and project.fingerprint:
            return project.fingerprint
        return "" if known is None else known.fingerprint

    def keep_check(self, name: str, found: ModelCheck) -> None:
        """Remember what was found of a model."""
        self._checks[name] = found

    def taken(self, pid: object) -> Taken:
        """What is taken of a project; stopping early only since the app was started.

        Raises:
            ProjectError: if there is no such project.
        """
        with self.reading(pid) as project:
            early = str(pid) in self._early
            return Taken(project.vote, project.coverage, early, project.all_questions)

    def stop_early(self, pid: object, early: bool) -> None:
        """Remember whether trying a project's recognizer stops as soon as the verdict is sure."""
        (self._early.add if early else self._early.discard)(str(pid))

    def _name(self, pid: str) -> str:
        path = self.root / pid / "project.json"
        try:
            seen = path.stat()
            state = (seen.st_mtime_ns, seen.st_size, seen.st_ino)
            if self._names.get(pid, ((), ""))[0] != state:  # a large file takes long to check
                self._names[pid] = state, parse_project(path.read_bytes(), path).name
            return self._names[pid][1]
        except (OSError, ProjectError):
            return pid

    def _entry(self, pid: object) -> _Open:
        """Ids are looked up in a listing of the folder; they never become a path unseen."""
        known = {path.parent.name for path in self.root.glob("*/project.json")}
        if not isinstance(pid, str) or pid not in known:
            raise ProjectError("there is no such project here; choose one above, or make a new one")
        with self._lock:
            return self._open.setdefault(pid, _Open())
