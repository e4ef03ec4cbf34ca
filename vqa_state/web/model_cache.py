"""The models of the app: one in memory, and beside it the small one of the package.

A model may fill the memory, so another one takes its place; a job that still works with the old
one keeps it until it ends, and a second copy is never loaded beside it.
"""

import contextlib
import threading
from weakref import WeakValueDictionary

from vqa_state import models
from vqa_state.errors import NotApprovedError
from vqa_state.models import VQAModel
from vqa_state.models.address import ModelAddress
from vqa_state.models.approval import check_approved

__all__ = ["Shelf"]

_SMALL = "embedded"


class Shelf:
    """Its methods may be called from any thread."""

    def __init__(self) -> None:
        self._kept: dict[str, VQAModel] = {}
        self._at_work: WeakValueDictionary[str, VQAModel] = WeakValueDictionary()
        self._lock = threading.Lock()
        self._loading = threading.Lock()

    def get(self, name: str) -> VQAModel:
        """The model with this name. One that is here waits for none that loads.

        Raises:
            UnknownModelError: if the registry has no such name.
            NotApprovedError: if the user never said yes to it, or took the yes back.
            ModelError: if it cannot be loaded.
        """
        self._check(name)
        found = self.loaded(name)
        if found is not None:
            return self._keep(name, found)
        with self._loading:  # two that load at once would need the memory of both
            found = self.loaded(name)  # another page may have waited for the same one
            return self._keep(name, models.create(name) if found is None else found)

    def loaded(self, name: str) -> VQAModel | None:
        """The model if it is in memory already; nothing is loaded."""
        with self._lock:
            kept = self._kept.get(name)
            return self._at_work.get(name) if kept is None else kept

    def _keep(self, name: str, model: VQAModel) -> VQAModel:
        with self._lock:
            for other in [one for one in self._kept if _SMALL not in (one, name)]:
                del self._kept[other]
            self._kept[name] = model
            with contextlib.suppress(TypeError):  # a class may forbid to be referred to weakly
                self._at_work[name] = model
        return model

    def _check(self, name: str) -> None:
        if name in models.names() or ":" not in name:
            return
        try:
            check_approved(ModelAddress.parse(name))
        except NotApprovedError:
            with self._lock:
                self._kept.pop(name, None)
                self._at_work.pop(name, None)
            raise
