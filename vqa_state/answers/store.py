"""The answer store: every answer ever bought, by what can change it, in one SQLite file.

An answer is in the store before it is counted. A kill at any moment loses at most what was not
yet committed. The key holds the hash of the image's pixels rather than of its file: it is what
the model sees, and a webcam frame has no file.
"""

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from vqa_state.answers.answer import Answer
from vqa_state.errors import StoreError
from vqa_state.images.augmentation import Augmentation

__all__ = ["AnswerStore", "CopyKey", "copy_keys"]

#: The scripts that lead from each version to the next; new ones are appended, none is changed.
_MIGRATIONS = (
    """
CREATE TABLE model (id INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL UNIQUE);
CREATE TABLE question (id INTEGER PRIMARY KEY, text TEXT NOT NULL UNIQUE);
CREATE TABLE copy (
    id INTEGER PRIMARY KEY,
    pixel_hash TEXT NOT NULL, kind TEXT NOT NULL, amount REAL NOT NULL,
    seed INTEGER NOT NULL, number INTEGER NOT NULL,
    UNIQUE (pixel_hash, kind, amount, seed, number)
);
CREATE TABLE answer (
    model INTEGER NOT NULL REFERENCES model, copy INTEGER NOT NULL REFERENCES copy,
    question INTEGER NOT NULL REFERENCES question,
    text TEXT NOT NULL, p_yes REAL,
    PRIMARY KEY (model, copy, question)
) WITHOUT ROWID;
""",
    # Why an answer ended: "length" for the length limit, NULL otherwise and where nobody noted it.
    "ALTER TABLE answer ADD COLUMN finish TEXT",
)
_VERSION = len(_MIGRATIONS)
_AT_LIMIT = "length"


@dataclass(frozen=True, slots=True)
class CopyKey:
    """All that makes one copy's pixels: the image, kind and range of the change, seed, number."""

    pixel_hash: str
    kind: str
    amount: float
    seed: int
    number: int


def copy_keys(pixel_hash: str, augmentation: Augmentation, seed: int) -> list[CopyKey]:
    """The keys of all copies of one image, in order of their numbers."""
    return [
        CopyKey(pixel_hash, augmentation.kind.value, augmentation.amount, seed, number)
        for number in range(augmentation.n_copies)
    ]


class AnswerStore:
    """One open connection; use it as a context manager, in one thread.

    Raises:
        StoreError: in every method, if the file is damaged, newer than this program, or the disk
            is full.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._explained():
            self._db = sqlite3.connect(path, timeout=30, isolation_level=None)
        try:
            with self._explained():
                self._prepare()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "AnswerStore":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; what was saved stays."""
        self._db.close()

    def save(self, fingerprint: str, answers: Iterable[tuple[CopyKey, str, Answer]]) -> None:
        """Keep (copy, question text, answer) triples, all or none; an answer kept before stays."""
        with self._explained(), self._transaction():
            model = self._id("model", ("fingerprint",), (fingerprint,))
            self._db.executemany(
                "INSERT OR IGNORE INTO answer VALUES (?, ?, ?, ?, ?, ?)",
                [
                    (model, self._copy_id(key), self._question_id(text), *_row(answer))
                    for key, text, answer in answers
                ],
            )

    def answers(
        self, fingerprint: str, key: CopyKey, questions: Sequence[str]
    ) -> dict[str, Answer]:
        """What the model with this fingerprint said about one copy, by question text."""
        wanted = set(questions)
        with self._explained():
            rows = self._db.execute(
                "SELECT question.text, answer.text, p_yes, finish FROM answer"
                " JOIN model ON model.id = answer.model JOIN question ON question.id = question"
                " JOIN copy ON copy.id = copy WHERE fingerprint = ? AND pixel_hash = ?"
                " AND kind = ? AND amount = ? AND seed = ? AND number = ?",
                (fingerprint, key.pixel_hash, key.kind, key.amount, key.seed, key.number),
            )
            return {text: _answer(*said) for text, *said in rows if text in wanted}

    def __len__(self) -> int:
        with self._explained():
            return int(self._db.execute("SELECT count(*) FROM answer").fetchone()[0])

    def _prepare(self) -> None:
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        if version > _VERSION:
            raise StoreError(
                f"{self._path} was written by a newer version of this program (store version "
                f"{version}, this program reads up to {_VERSION}); update the program"
            )
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        if version < _VERSION:
            with self._transaction():  # all steps or none, and another program may have been first
                version = self._db.execute("PRAGMA user_version").fetchone()[0]
                for script in _MIGRATIONS[version:]:
                    for statement in script.split(";"):
                        self._db.execute(statement)
                self._db.execute(f"PRAGMA user_version = {max(version, _VERSION)}")

    def _copy_id(self, key: CopyKey) -> int:
        values = (key.pixel_hash, key.kind, key.amount, key.seed, key.number)
        return self._id("copy", ("pixel_hash", "kind", "amount", "seed", "number"), values)

    def _question_id(self, text: str) -> int:
        return self._id("question", ("text",), (text,))

    def _id(self, table: str, columns: tuple[str, ...], values: tuple[object, ...]) -> int:
        """The row's id, made when new. Table and columns are constants of this file."""
        where = " AND ".join(f"{column} = ?" for column in columns)
        select = f"SELECT id FROM {table} WHERE {where}"  # noqa: S608
        row = self._db.execute(select, values).fetchone()
        if row is None:
            marks = ", ".join("?" * len(columns))
            insert = f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({marks})"  # noqa: S608
            row = (self._db.execute(insert, values).lastrowid,)
        if not isinstance(row[0], int):
            raise sqlite3.DatabaseError(f"a row of the table {table!r} has no id")
        return row[0]

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._db.execute("COMMIT")
        except BaseException:
            self._db.rollback()
            raise

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.ProgrammingError:
            raise  # our own mistake: a closed store, or another thread's
        except sqlite3.OperationalError as error:
            raise StoreError(
                f"the answers in {self._path} cannot be read or written ({error}); nothing that "
                "was stored is lost: check free disk space and permissions, then start again"
            ) from error
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # SQLite quotes damage
            raise StoreError(
                f"{self._path} is not an answer store or is damaged ({error}); restore it from a "
                "backup, or move it away to ask all questions again"
            ) from error


def _row(answer: Answer) -> tuple[str, float | None, str | None]:
    return answer.text, answer.p_yes, _AT_LIMIT if answer.at_limit else None


def _answer(text: str, p_yes: float | None, finish: str | None) -> Answer:
    if finish not in (None, _AT_LIMIT):
        raise sqlite3.DatabaseError(f"row {text!r}: an answer cannot have ended by {finish!r}")
    try:
        return Answer(text, p_yes, finish == _AT_LIMIT)
    except (AttributeError, TypeError, ValueError) as error:
        raise sqlite3.DatabaseError(f"row {text!r}, {p_yes!r}: {error}") from error
