"""A project: one folder that a person can read.

project.json, images/ (the bytes as given, named by their SHA-256), answers.sqlite, searches/,
recognizers/ and thumbnails/. No path is made of a user's text.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from vqa_state.errors import ImageError, ProjectError
from vqa_state.images.augmentation import Augmentation
from vqa_state.images.near_duplicates import look_alikes, perceptual_hash
from vqa_state.images.picture_input import PictureInput, picture_bytes
from vqa_state.images.reading import content_hash, pixel_hash, read_picture, thumbnail
from vqa_state.project.schema import SCHEMA_VERSION, LabelledImage, ProjectFile, parse_project
from vqa_state.project.split import Split, astride, divide
from vqa_state.questions.grid import Question, QuestionGrid, Wording, clean_text, phrases_for
from vqa_state.questions.states import StateNames
from vqa_state.search.default import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.storage.atomic_write import write_atomically
from vqa_state.votes.rules import VoteKind

__all__ = ["MAX_IMAGES", "Added", "LabelledImage", "Project", "StateNames"]

MAX_IMAGES: Final = 5000
_FILE = "project.json"


@dataclass(frozen=True, slots=True)
class Added:
    """Outcome of adding one picture; `is_new` is False for bytes that the project has already."""

    image: LabelledImage
    is_new: bool


@dataclass
class Project:
    """A folder with images, labels, questions and settings. Changes last only after `save()`.

        project = Project.create("fridge", "refrigerator", ("open", "closed"))
        project.add_wordings("refrigerator", "refrigerator door")
        project.add("photo.jpg", label="open")
        project.assign_splits()
        project.save()

    Everything but the fields themselves is frozen, so a long task can work on what it took at
    its start.
    """

    folder: Path
    name: str
    states: StateNames
    images: dict[str, LabelledImage] = field(default_factory=dict)
    grid: QuestionGrid = field(default_factory=QuestionGrid)
    model: str = "embedded"
    fingerprint: str | None = None
    """Of the model that was asked last; None before the first question."""
    seed: int = 0
    """Of the copies and of the split."""
    augmentation: Augmentation = field(default_factory=Augmentation)
    search_seed: int = 0
    engine: Engine = Engine.DEFAULT
    """How to search: longer and with proof, or exactly as in the paper."""
    search: SearchSettings = field(default_factory=SearchSettings)
    weights: ObjectiveWeights = field(default_factory=ObjectiveWeights)
    chosen: Objective = Objective.S_PLUS
    """The recognizer that is exported first. Source: the paper advises s+ for accuracy."""
    vote: VoteKind = VoteKind.PAPER
    """How the exported recognizer counts answers; an assessment learns the other kinds."""
    coverage: float | None = None
    """Share of images that shall get a verdict, in (0, 1); None abstains only at ties."""
    all_questions: bool = False
    """Export all questions by the paper's vote; `chosen`, `vote` and `coverage` wait meanwhile."""
    test_looks: int = 0
    """How often the user has looked at the test results."""
    _seen: str = field(default="", repr=False)

    @classmethod
    def create(
        cls,
        folder: str | PathLike[str],
        name: str,
        states: StateNames | tuple[str, str],
        *,
        grid: QuestionGrid | None = None,
    ) -> "Project":
        """Make a new project in a folder that holds none.

        Args:
            folder: is made if it does not exist.
            name: what the thing is called.
            states: names of the positive and the negative state.
            grid: of questions; without it there is none until `add_wordings`.

        Raises:
            ProjectError: if the folder holds a project already or cannot be written.
        """
        folder = Path(folder)
        states = states if isinstance(states, StateNames) else StateNames(*states)
        if (folder / _FILE).exists():
            raise ProjectError(f"{folder} holds a project already; open it or name another folder")
        project = cls(folder, clean_text(name, "the project's name"), states)
        project.grid = grid or project.grid
        project.save()
        return project

    @classmethod
    def open(cls, folder: str | PathLike[str]) -> "Project":
        """Read a project.

        Raises:
            ProjectError: if there is none, or it is damaged or newer than this program.
        """
        folder = Path(folder)
        path = folder / _FILE
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ProjectError(
                f"{folder} holds no project ({_FILE}: {error.strerror}); make one with "
                "`python -m vqa_state new` or in the app"
            ) from error
        content = parse_project(data, path)
        images = {image.id: image for image in content.images}
        fields = {k: getattr(content, k) for k in ProjectFile.model_fields if k != "schema_version"}
        return cls(folder, **(fields | {"images": images}), _seen=_digest(data))

    def save(self) -> None:
        """Write project.json, whole or not at all.

        Raises:
            ProjectError: if the disk is full, or another program changed the file meanwhile.
        """
        path = self.folder / _FILE
        if self.changed_elsewhere():
            raise ProjectError(
                f"{path} was changed by another program since it was opened; open the project "
                "again and repeat the last step"
            )
        fields = {k: getattr(self, k) for k in ProjectFile.model_fields if k != "schema_version"}
        try:
            content = ProjectFile(
                **(
                    fields
                    | {"schema_version": SCHEMA_VERSION, "images": tuple(self.images.values())}
                )
            )
        except ValidationError as error:
            first = error.errors()[0]
            raise ProjectError(
                f"the project was not saved: {'.'.join(map(str, first['loc']))} cannot be "
                f"{first['input']!r} ({first['msg']}); give another value"
            ) from error
        data = (content.model_dump_json(indent=1) + "\n").encode()
        if not path.exists() or _digest(data) != self._seen:  # else it stands there already
            write_atomically(path, data)
            self._seen = _digest(data)

    def changed_elsewhere(self) -> bool:
        """Whether project.json is no longer what this object read or wrote last."""
        path = self.folder / _FILE
        return path.exists() and _digest(path.read_bytes()) != self._seen

    @property
    def store_path(self) -> Path:
        """The SQLite file with all answers."""
        return self.folder / "answers.sqlite"

    def questions(self) -> tuple[Question, ...]:
        """The questions that are asked.

        Raises:
            ProjectError: if there is none.
        """
        questions = self.grid.build().questions
        if not questions:
            raise ProjectError(
                f"the project {self.name!r} has no questions; give at least one wording and one "
                "state phrase, or a question of your own"
            )
        return questions

    def add_wordings(self, *wordings: str) -> None:
        """Ask about the thing by these names, too: each gives a question for every form and phrase.

        Args:
            wordings: nouns such as "refrigerator door", or "water | from {article} faucet".

        Raises:
            QuestionError: if one cannot be used, or there would be too many questions.
        """
        added = tuple(Wording.parse(wording) for wording in wordings)
        states = phrases_for(self.states.positive, self.states.negative)
        self.grid = replace(
            self.grid,
            wordings=tuple(dict.fromkeys((*self.grid.wordings, *added))),
            phrases=self.grid.phrases or states,
        )

    def add_questions(self, *questions: Question) -> None:
        """Ask these questions beside those of the grid.

        Raises:
            QuestionError: if there would be too many questions.
        """
        own = tuple(dict.fromkeys((*self.grid.custom, *questions)))
        self.grid = replace(self.grid, custom=own)

    def add(self, picture: PictureInput, name: str = "", label: int | str | None = None) -> Added:
        """Keep a picture's bytes under their SHA-256.

        Bytes that the project has already are the same image; it keeps the label that it has, and
        a file that is gone or damaged is written again.

        Args:
            picture: a path, a file's content, a Pillow image, or an array of uint8 RGB values,
                shape (height, width, 3); the last two are kept as PNG.
            name: shown to people; without one, the file's.
            label: +1 or -1, the name of a state, or None for none.

        Raises:
            ImageError: if the picture cannot be read, has the other label already, or the project
                is full.
            ProjectError: if it cannot be written, or no state has the label's name.
        """
        data = picture_bytes(picture)
        label = self.states.named(label) if isinstance(label, str) else label
        if not name and isinstance(picture, str | PathLike):
            name = Path(picture).name
        image_id = content_hash(data)
        if image_id in self.images:
            self._restore(self.images[image_id], data)
            self._label_again(self.images[image_id], label)
            return Added(self.images[image_id], is_new=False)
        if len(self.images) >= MAX_IMAGES:
            raise ImageError(f"the project has {MAX_IMAGES:,} images, the most that it can hold")
        decoded = read_picture(data)
        image = LabelledImage(
            id=image_id,
            pixel_hash=pixel_hash(decoded.pixels),
            looks=perceptual_hash(decoded.pixels),
            suffix=decoded.suffix,  # type: ignore[arg-type]  # read_picture gives these five
            name=_shown(name),
        )
        write_atomically(self.image_path(image), data)
        write_atomically(self._thumbnail_path(image), thumbnail(decoded.pixels))
        self.images[image_id] = image
        self.set_labels([image_id], label)
        return Added(self.images[image_id], is_new=True)

    def _label_again(self, image: LabelledImage, label: int | None) -> None:
        """The same bytes under two labels are a mistake that only the user can mend."""
        if label is None or label == image.label:
            return
        if image.label is not None:
            raise ImageError(
                f"the same picture is in the project already, as {self.states.of(image.label)!r} "
                f"({image.name}); it keeps that label: change it by hand if it is wrong"
            )
        self.set_labels([image.id], label)

    def remove(self, ids: Iterable[str]) -> None:
        """Take images out of the project, and their files; answers about them stay stored."""
        for image in [self._image(image_id) for image_id in dict.fromkeys(ids)]:
            del self.images[image.id]
            self.image_path(image).unlink(missing_ok=True)
            self._thumbnail_path(image).unlink(missing_ok=True)

    def set_labels(self, ids: Iterable[str], label: int | None, *, accepted: bool = False) -> None:
        """Give images the label +1 or -1, or take it away with None.

        An `accepted` label came from a vote, so its image becomes a training image and cannot
        become a test image until a person labels it.

        Raises:
            ProjectError: if an id or the label is unknown; nothing is changed then.
        """
        if label not in (-1, 1, None):
            raise ProjectError(f"a label is +1, -1 or none, got {label!r}")
        for image in [self._image(image_id) for image_id in ids]:
            split = image.split if label is not None or image.split is Split.UNUSED else None
            if accepted and split is not Split.UNUSED:
                split = Split.TRAIN
            self.images[image.id] = replace(image, label=label, split=split, accepted=accepted)  # type: ignore[arg-type]  # checked above

    def set_splits(self, ids: Iterable[str], split: Split | None) -> None:
        """Put images on a side by hand; None lets `assign_splits` decide again.

        Raises:
            ProjectError: if an id is unknown, or a label that a vote suggested would judge votes;
                nothing is changed then.
        """
        images = [self._image(image_id) for image_id in ids]
        pinned = [image.name for image in images if image.accepted]
        if pinned and split is Split.TEST:
            raise ProjectError(
                f"the label of {pinned[0]} was suggested by a vote, so it must not test one; look "
                "at the image and label it yourself first, then it may"
            )
        for image in images:
            self.images[image.id] = replace(image, split=split)

    def assign_splits(self, *, train_share: float = 0.5, afresh: bool = False) -> None:
        """Divide labelled images between train and test; look-alikes go to one side.

        Images whose label a vote suggested stay training images.

        Args:
            train_share: share of training images of each state, in (0, 1).
            afresh: divide all but the unused again, instead of only those without a side.
        """
        fixed = {
            i.id: i.split
            for i in self.images.values()
            if i.split is not None and (not afresh or i.split is Split.UNUSED or i.accepted)
        } | {i.id: Split.TRAIN for i in self.images.values() if i.accepted and i.split is None}
        labels = {i.id: i.label for i in self.images.values() if i.label is not None}
        sides = divide(labels, self.look_alikes(), fixed, train_share=train_share, seed=self.seed)
        for image_id, side in sides.items():
            self.images[image_id] = replace(self.images[image_id], split=side)

    def look_alikes(self) -> list[tuple[str, ...]]:
        """Groups of image ids that look alike (the user is told of them)."""
        return look_alikes({i.id: i.looks for i in self.images.values()})

    def look_alikes_astride(self) -> list[tuple[str, ...]]:
        """Groups of look-alikes on both sides: a test image nearly is a training image there."""
        sides = {i.id: i.split for i in self.images.values() if i.split is not None}
        return [tuple(group) for group in astride(self.look_alikes(), sides)]

    def labelled(self, *splits: Split) -> tuple[LabelledImage, ...]:
        """Labelled images on these sides, in the order of their ids: no order of adding counts."""
        chosen = (i for i in self.images.values() if i.label is not None and i.split in splits)
        return tuple(sorted(chosen, key=lambda image: image.id))

    def image_path(self, image: LabelledImage) -> Path:
        """Where the image's bytes lie."""
        return self.folder / "images" / f"{image.id}.{image.suffix}"

    def thumbnail(self, image_id: str) -> bytes:
        """A small WebP of an image, made again if it was deleted.

        Raises:
            ProjectError: if the project has no such image.
            ImageError: if its file is damaged.
        """
        image = self._image(image_id)
        path = self._thumbnail_path(image)
        if path.is_symlink() or not path.exists():  # a link could show any file of this machine
            write_atomically(path, thumbnail(read_picture(self.read(image)).pixels))
        return path.read_bytes()

    def read(self, image: LabelledImage) -> bytes:
        """The image's bytes as given.

        Raises:
            ImageError: if the file is gone or is no longer the one that was added.
        """
        try:
            data = self.image_path(image).read_bytes()
        except OSError as error:
            raise ImageError(f"the file of {image.name} is gone; add the picture again") from error
        if content_hash(data) != image.id:
            raise ImageError(f"the file of {image.name} has changed; add the picture again")
        return data

    def _restore(self, image: LabelledImage, data: bytes) -> None:
        try:
            self.read(image)
        except ImageError:
            write_atomically(self.image_path(image), data)

    def _thumbnail_path(self, image: LabelledImage) -> Path:
        return self.folder / "thumbnails" / f"{image.id}.webp"

    def _image(self, image_id: str) -> LabelledImage:
        try:
            return self.images[image_id]
        except KeyError:
            raise ProjectError(f"the project has no image {image_id[:80]!r}") from None


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _shown(name: str) -> str:
    printable = "".join(c for c in name if c.isprintable())
    return printable[-200:] or "unnamed"
