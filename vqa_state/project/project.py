"""A project: one folder that a person can read.

project.json, images/ (the bytes as given, named by their SHA-256), answers.sqlite, searches/,
recognizers/ and thumbnails/. No path is made of a user's text. Several programs may change one
project: see docs/decisions/0017-two-programs.md.
"""

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Final

from vqa_state.errors import ConflictError, ImageError, ProjectError
from vqa_state.images import content_hash, perceptual_hash, pixel_hash, reading, thumbnail
from vqa_state.images.augmentation import Augmentation
from vqa_state.images.near_duplicates import look_alikes
from vqa_state.images.picture_input import PictureInput, picture_bytes
from vqa_state.project.leftovers import Journal, has_leftovers, remove_leftovers, remove_pictures
from vqa_state.project.merging import merge
from vqa_state.project.schema import (
    LabelledImage,
    ProjectFile,
    checked_content,
    fields_of,
    parse_project,
)
from vqa_state.project.split import Split, astride, divide
from vqa_state.questions.grid import Question, QuestionGrid, Wording, clean_text, phrases_for
from vqa_state.questions.states import StateNames
from vqa_state.search.engines import Engine
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.storage.atomic_write import PROJECT_FILE, write_atomically
from vqa_state.storage.locks import locked
from vqa_state.votes.rules import VoteKind

__all__ = ["MAX_IMAGES", "Added", "LabelledImage", "Project", "StateNames"]

MAX_IMAGES: Final = 5000


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

    Other programs may change the folder meanwhile: `save()` keeps what they saved. Everything but
    the fields themselves is frozen, so a long task can work on what it took at its start.
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
    _base: ProjectFile | None = field(default=None, repr=False, compare=False)
    """What was read or written last; None before that."""
    _removed: dict[str, LabelledImage] = field(
        init=False, default_factory=dict, repr=False, compare=False
    )
    """Images whose files go with the next `save()`."""
    _journal: Journal = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._journal = Journal(self.folder)

    @classmethod
    def create(
        cls,
        folder: str | PathLike[str],
        name: str,
        states: StateNames | tuple[str, str],
        *,
        grid: QuestionGrid | None = None,
        seed: int = 0,
    ) -> "Project":
        """Make a new project in a folder that holds none.

        Args:
            folder: is made if it does not exist.
            name: what the thing is called.
            states: names of the positive and the negative state.
            grid: of questions; without it there is none until `add_wordings`.
            seed: of the copies and of the split.

        Raises:
            ProjectError: if the folder holds a project already or cannot be written.
        """
        folder = Path(folder)
        states = states if isinstance(states, StateNames) else StateNames(*states)
        project = cls(folder, clean_text(name, "the project's name"), states, seed=seed)
        project.grid = grid or project.grid
        with locked(folder):
            if (folder / PROJECT_FILE).exists():
                raise ProjectError(
                    f"{folder} holds a project already; open it or name another folder"
                )
            remove_leftovers(folder, ())
            project.save()
        return project

    @classmethod
    def open(cls, folder: str | PathLike[str]) -> "Project":
        """Read a project, and remove what a killed program left in it.

        Raises:
            ProjectError: if there is none, or it is damaged or newer than this program.
        """
        folder = Path(folder)
        project = cls._read(folder)
        if has_leftovers(folder, project._file_names()):
            # A program at work looks the same; the next opening removes what is left then.
            with suppress(ProjectError), locked(folder, wait=0):
                project = cls._read(folder)
                remove_leftovers(folder, project._file_names())
        return project

    @classmethod
    def _read(cls, folder: Path) -> "Project":
        path = folder / PROJECT_FILE
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ProjectError(
                f"{folder} holds no project ({PROJECT_FILE}: {error.strerror}); make one with "
                "`python -m vqa_state new` or in the app"
            ) from error
        content = parse_project(data, path)
        return cls(folder, **fields_of(content), _seen=_digest(data), _base=content)

    @contextmanager
    def changing(self) -> Iterator["Project"]:
        """Be alone with the folder for a short change: take in what others saved, change, save.

        Raises:
            ProjectError: if somebody else holds the folder for long, or whatever `save` raises.
        """
        with locked(self.folder):
            self.catch_up()
            yield self
            self.save()

    def save(self) -> None:
        """Write project.json, whole or not at all, with what other programs saved meanwhile.

        Raises:
            ConflictError: if another program changed the same thing otherwise; neither is lost:
                this object and the file stay as they are.
            ProjectError: if the disk is full, or somebody else holds the folder for long.
        """
        path = self.folder / PROJECT_FILE
        with locked(self.folder):
            self.catch_up()
            content = self._content()
            data = (content.model_dump_json(indent=1) + "\n").encode()
            if not path.exists() or _digest(data) != self._seen:  # else it stands there already
                self._journal.note([_file_name(one) for one in self._removed.values()])
                write_atomically(path, data)
                self._seen = _digest(data)
            self._base = content
            if self._removed:
                gone = {_file_name(one) for one in self._removed.values()}
                remove_pictures(self.folder, gone - self._file_names())
                self._removed.clear()
            self._journal.close()

    def catch_up(self) -> None:
        """Take in what other programs saved since this object read or wrote project.json.

        Raises:
            ConflictError: if one changed what was changed here, otherwise; nothing is changed.
            ProjectError: if the file is damaged, or is of another project than this new one.
        """
        path = self.folder / PROJECT_FILE
        if not path.exists() or _digest(data := path.read_bytes()) == self._seen:
            return
        if self._base is None:
            raise ProjectError(f"{self.folder} holds a project already; open it first")
        theirs = parse_project(data, path)
        merged = merge(self._base, self._content(), theirs)
        if len(merged.images) > max(MAX_IMAGES, len(theirs.images)):
            raise ConflictError([f"both together have more than {MAX_IMAGES:,} images"])
        for name, value in fields_of(merged).items():
            setattr(self, name, value)
        self._base, self._seen = theirs, _digest(data)

    def _content(self) -> ProjectFile:
        return checked_content(vars(self), self.images.values())

    def _file_names(self) -> set[str]:
        return {_file_name(image) for image in self.images.values()}

    def changed_elsewhere(self) -> bool:
        """Whether project.json is no longer what this object read or wrote last."""
        path = self.folder / PROJECT_FILE
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
        with reading(data) as decoded:
            image = LabelledImage(
                id=image_id,
                pixel_hash=pixel_hash(decoded.pixels),
                looks=perceptual_hash(decoded.pixels),
                suffix=decoded.suffix,  # type: ignore[arg-type]  # reading gives these six
                name=_shown(name),
            )
            small = thumbnail(decoded.pixels)
        self._journal.note([_file_name(image)])
        try:
            write_atomically(self.image_path(image), data)
        except ProjectError:
            self._journal.forget(_file_name(image))
            raise
        write_atomically(self._thumbnail_path(image), small)
        self.images[image_id] = image
        self._removed.pop(image_id, None)
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
        """Take images out of the project; their files go when it is saved, stored answers stay."""
        for image in [self._image(image_id) for image_id in dict.fromkeys(ids)]:
            self._removed[image.id] = self.images.pop(image.id)

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
        return self.folder / "images" / _file_name(image)

    def thumbnail(self, image_id: str) -> bytes:
        """A small WebP of an image, made again if it was deleted.

        Raises:
            ProjectError: if the project has no such image.
            ImageError: if its file is damaged.
        """
        image = self._image(image_id)
        path = self._thumbnail_path(image)
        if path.is_symlink() or not path.exists():  # a link could show any file of this machine
            with reading(self.read(image)) as picture:
                small = thumbnail(picture.pixels)
            write_atomically(path, small)
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


def _file_name(image: LabelledImage) -> str:
    return f"{image.id}.{image.suffix}"


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _shown(name: str) -> str:
    printable = "".join(c for c in name if c.isprintable())
    return printable[-200:] or "unnamed"
