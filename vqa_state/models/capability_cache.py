"""What this machine has found out about models: if they see, how fast they are, what they take.

Kept by fingerprint, so that a model is looked at once. The file belongs to no project; if it is
lost or damaged, models are looked at once more.
"""

import contextlib
import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from vqa_state.errors import ProjectError
from vqa_state.models.approval import data_folder
from vqa_state.models.vision_check import Sight
from vqa_state.storage.atomic_write import write_atomically

__all__ = ["KnownModel", "known_as", "known_model", "remember"]

#: The file keeps so many models, the last ones.
_MOST = 200

_MAX_BYTES = 10_000_000


@dataclass(frozen=True, slots=True)
class KnownModel:
    """What is known of a model here; what was not found out yet is None or 0.

    Attributes:
        name, fingerprint: see `VQAModel`.
        sight: what a look found.
        image, question: seconds for an image, and for each question about it; both or neither.
        megabytes: memory of a process with the model in it.
        gpu_megabytes: memory of the graphics card.

    Raises:
        ValueError: if a time or a size cannot be one.
    """

    name: str
    fingerprint: str
    sight: Sight | None = None
    image: float | None = None
    question: float | None = None
    megabytes: int = 0
    gpu_megabytes: int = 0

    def __post_init__(self) -> None:
        if (self.image is None) != (self.question is None):
            raise ValueError("the seconds of an image and of a question are known together")
        for number in (self.image, self.question, self.megabytes, self.gpu_megabytes):
            if number is not None and not (0 <= number < math.inf):
                raise ValueError(f"a time or a size is no such number: {number}")


def known_model(fingerprint: str) -> KnownModel | None:
    """What is known of the model with this fingerprint; None if it was never looked at."""
    return _read().get(fingerprint)


def known_as(name: str) -> KnownModel | None:
    """What was found last of a model with this name, which may have changed since."""
    return next((one for one in reversed(_read().values()) if one.name == name), None)


def remember(found: KnownModel) -> None:
    """Keep it beside what was known. If that cannot be written, the next look finds it anew."""
    models = _read()
    old = models.pop(found.fingerprint, None)
    models[found.fingerprint] = found if old is None else _merged(old, found)
    kept = list(models.values())[-_MOST:]
    content = json.dumps([asdict(one) for one in kept], indent=1) + "\n"
    with contextlib.suppress(ProjectError):  # a run must not end because of it
        write_atomically(_file(), content.encode())


def _merged(old: KnownModel, new: KnownModel) -> KnownModel:
    return replace(
        new,
        sight=new.sight or old.sight,
        image=old.image if new.image is None else new.image,
        question=old.question if new.question is None else new.question,
        megabytes=new.megabytes or old.megabytes,
        gpu_megabytes=new.gpu_megabytes or old.gpu_megabytes,
    )


def _file() -> Path:
    return data_folder() / "known_models.json"


def _read() -> dict[str, KnownModel]:
    """By fingerprint, in the order in which they were found; a damaged record is left out."""
    try:
        with _file().open("rb") as opened:
            records = json.loads(opened.read(_MAX_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    found = [_model(record) for record in records] if isinstance(records, list) else []
    return {one.fingerprint: one for one in found if one is not None}


def _model(record: object) -> KnownModel | None:
    if not isinstance(record, dict):
        return None
    sight, numbers = record.get("sight"), (record.get("image"), record.get("question"))
    sizes = (record.get("megabytes"), record.get("gpu_megabytes"))
    texts = (record.get("name"), record.get("fingerprint"))
    if not all(isinstance(one, str) for one in texts):
        return None
    if not all(one is None or type(one) in (int, float) for one in numbers):
        return None
    if not all(type(one) is int for one in sizes):
        return None
    try:
        return KnownModel(*texts, Sight(sight) if sight else None, *numbers, *sizes)  # type: ignore[arg-type]
    except ValueError:
        return None
