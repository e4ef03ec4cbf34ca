"""Names in a ZIP file, read in the code page that they were written in.

A ZIP names its files by bytes. A flag says that they are UTF-8, and Info-ZIP writes the UTF-8 name
beside another one. All else is in the code page of the machine that packed it, of which the file
says nothing. So each page is tried, and the one is taken for the whole archive in which the most
files lie in a folder that is named as a state; of equals the one with the most in a folder named as
a side, and then the first one in `PAGES`.
Where no folder tells, that is UTF-8 if it fits, or else cp437, as ZIP itself says.

Source: APPNOTE.TXT of PKWARE, 4.4.4 (flag, bit 11) and 4.6.9 (Unicode path); Python's zipfile
reads every other name as cp437, which loses no byte.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from typing import Final
from zipfile import ZipInfo

from vqa_state.project.folder_names import folder_label, folder_split, name_parts
from vqa_state.questions.states import StateNames

__all__ = ["PAGES", "code_page", "entry_names"]

PAGES: Final = (
    "utf-8", "cp437",
    "cp850", "cp1252", "cp852", "cp1250",  # western and central Europe: DOS, Windows
    "cp932", "gb18030", "cp950", "cp949",  # Japanese, Chinese (GBK, Big5), Korean (EUC-KR)
    "cp866", "cp1251", "koi8-r", "cp855",  # Cyrillic
    "cp737", "cp1253", "cp857", "cp1254",  # Greek, Turkish
    "cp775", "cp1257", "cp862", "cp1255",  # Baltic, Hebrew
    "cp720", "cp1256", "cp874", "cp1258",  # Arabic, Thai, Vietnamese
    "euc-jp", "mac-roman",
)  # fmt: skip
"""Code pages that are tried, the likeliest first; GBK is part of gb18030, EUC-KR of cp949."""

_IS_UTF_8: Final = 0x800
_UNICODE_PATH: Final = 0x7075
_MOST_FOLDERS: Final = 2000
"""Folders that choose the page: a hostile archive could name a million."""


def entry_names(entries: Iterable[ZipInfo], states: Callable[[], StateNames]) -> list[str]:
    """The name of each entry, with slashes or backslashes as it has them, cut at a null byte.

    Args:
        entries: of one archive, as zipfile reads them.
        states: gives the names that folders may have; asked only where a code page must be chosen.
    """
    told = [_told(entry) for entry in entries]
    untold = [name for name in told if isinstance(name, bytes)]
    page = code_page(untold, states()) if untold else PAGES[0]
    names = (name if isinstance(name, str) else name.decode(page) for name in told)
    return [name.partition("\0")[0] for name in names]


def code_page(names: Sequence[bytes], states: StateNames) -> str:
    """The page of `PAGES` in which the most of these names lie in a folder named as a state."""
    whole = b"\n".join(names)
    # No page has a slash as the second byte of a character, but some have a backslash.
    folders = Counter(
        name if b"\\" in name else name.rpartition(b"/")[0] + b"/file" for name in names
    )
    few = list(islice(folders.items(), _MOST_FOLDERS))

    def n_told(page: str) -> tuple[int, int]:
        """Files with a label, and files with a side."""
        paths = [("/".join(name_parts(name.decode(page))), n) for name, n in few]
        labelled = sum(n for path, n in paths if folder_label(path, states) is not None)
        return labelled, sum(n for path, n in paths if folder_split(path) is not None)

    return max((page for page in PAGES if _fits(whole, page)), key=n_told)


def _fits(names: bytes, page: str) -> bool:
    try:
        names.decode(page)
    except UnicodeDecodeError:
        return False
    return True


def _told(entry: ZipInfo) -> str | bytes:
    """The name, or its bytes where nothing says what they mean."""
    if entry.flag_bits & _IS_UTF_8:
        return entry.orig_filename
    name = entry.orig_filename.encode("cp437")
    if name.isascii():
        return name.decode("ascii")
    beside = _unicode_path(entry.extra, name)
    return name if beside is None else beside


def _unicode_path(extra: bytes, name: bytes) -> str | None:
    """The UTF-8 name that Info-ZIP wrote beside this one, if it is still meant for it."""
    while len(extra) >= 4:
        kind, size = struct.unpack_from("<HH", extra)
        field, extra = extra[4 : 4 + size], extra[4 + size :]
        if kind != _UNICODE_PATH or len(field) < 5:
            continue
        version, checksum = struct.unpack_from("<BI", field)
        if version == 1 and checksum == zlib.crc32(name) and _fits(field[5:], "utf-8"):
            return field[5:].decode()
    return None
