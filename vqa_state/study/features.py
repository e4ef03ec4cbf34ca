"""Image features for the trained rival, kept in the project like answers: computed once.

features/HASH.npy holds the features of all copies of one picture, (n_copies, n_features), float32.
The hash is of all that can change them: the picture's pixels, its copies and the image network.
"""

import hashlib
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from PIL.Image import Image

from vqa_state.errors import ImageError
from vqa_state.images.augmentation import copies
from vqa_state.images.reading import read_picture
from vqa_state.project.project import LabelledImage, Project
from vqa_state.storage.atomic_write import write_atomically

__all__ = ["FeatureProgress", "Featurizer", "embedded_features", "features_of"]


class Featurizer(Protocol):
    """Pictures to rows of numbers.

    Attributes:
        n_features: numbers a picture.
        fingerprint: all that can change a number.
    """

    n_features: int
    fingerprint: str

    def __call__(self, images: Sequence[Image]) -> Iterator[NDArray[np.float32]]:
        """Yield the features of every image, (n_features,), in order."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class FeatureProgress:
    """After one picture more.

    Attributes:
        n_done: pictures that have their features.
        n_total: pictures in all.
        features: by image id, (n_copies, n_features) each.
        failures: why a picture has none, by image id.
    """

    n_done: int
    n_total: int
    features: dict[str, NDArray[np.float32]]
    failures: dict[str, str]


def embedded_features() -> Featurizer:
    """Those of the embedded model's image network.

    Raises:
        ModuleNotFoundError: if torch or safetensors is not installed.
        ModelError: if the weights are missing or damaged.
    """
    from vqa_state.models.embedded.pooled import PooledFeatures

    return PooledFeatures()


def features_of(
    project: Project,
    images: Sequence[LabelledImage],
    featurizer: Featurizer,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[FeatureProgress]:
    """Features of the copies that are asked about; those on disk are not computed again.

    A picture that cannot be read has none and is told of; it ends nothing.

    Raises:
        ProjectError: if a file cannot be written.
    """
    features: dict[str, NDArray[np.float32]] = {}
    failures: dict[str, str] = {}
    for n_done, image in enumerate(images, 1):
        try:
            features[image.id] = _stored(project, image, featurizer)
        except ImageError as error:
            failures[image.id] = str(error)
        yield FeatureProgress(n_done, len(images), features, failures)
        if stop():
            return


def _stored(project: Project, image: LabelledImage, featurizer: Featurizer) -> NDArray[np.float32]:
    path = _path(project, image, featurizer.fingerprint)
    shape = project.augmentation.n_copies, featurizer.n_features
    found = _read(path, shape)
    if found is None:
        pixels = read_picture(project.read(image)).pixels
        shifted = list(copies(pixels, image.pixel_hash, project.augmentation, project.seed))
        found = np.stack(list(featurizer(shifted))).astype(np.float32)
        data = io.BytesIO()
        np.save(data, found, allow_pickle=False)
        write_atomically(path, data.getvalue())
    return found


def _read(path: Path, shape: tuple[int, int]) -> NDArray[np.float32] | None:
    """What is on disk; a damaged file counts as none, it takes moments to make it again."""
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    whole = isinstance(found, np.ndarray) and found.shape == shape and found.dtype == np.float32
    return found if whole and np.isfinite(found).all() else None


def _path(project: Project, image: LabelledImage, fingerprint: str) -> Path:
    shifts = project.augmentation
    parts = (
        fingerprint, image.pixel_hash, shifts.kind.value, shifts.amount, shifts.n_copies,
        project.seed,
    )  # fmt: skip
    return project.folder / "features" / f"{hashlib.sha256(repr(parts).encode()).hexdigest()}.npy"
