"""Which files of a model's folder are read when it is loaded; all others change no answer."""

from fnmatch import fnmatchcase
from pathlib import Path

from vqa_state.models.local.families import weight_files

__all__ = ["loaded_files"]

_SETTINGS = (
    "config.json",
    "generation_config.json",
    "preprocessor_config.json",
    "processor_config.json",
    "video_preprocessor_config.json",
)

#: Words of a tokenizer and how a chat is written, by any name that a class of transformers uses.
_WORDS = (
    *("tokenizer*.json", "special_tokens_map.json", "added_tokens.json", "tekken.json"),
    *("*vocab*.json", "*vocab*.txt", "merges.txt", "dict.txt", "emoji.json", "normalizer.json"),
    *("byte_maps.json", "word_shape.json", "word_pronunciation.json"),
    *("*.model", "*.tiktoken", "*.codes", "*.tokenizer", "tokenizer.model.*"),
    *("chat_template.json", "chat_template.jinja"),
)


def loaded_files(folder: Path) -> list[Path]:
    """Settings, words and weights, sorted; weights that are not there yet are left out.

    Raises:
        ModelError: if the weights' index is damaged, or names files elsewhere.
        OSError: if the folder cannot be read.
    """
    names = (*_SETTINGS, *_WORDS)
    found = [path for path in folder.iterdir() if _is_one_of(path, names)]
    for part in folder.iterdir():
        if part.is_dir() and part.name.endswith("_tokenizer"):
            found += [path for path in part.iterdir() if _is_one_of(path, _WORDS)]
    found += [path for path in folder.glob("additional_chat_templates/*.jinja") if path.is_file()]
    found += [path for name in weight_files(folder) if (path := folder / name).is_file()]
    return sorted(found)


def _is_one_of(path: Path, names: tuple[str, ...]) -> bool:
    return any(fnmatchcase(path.name, name) for name in names) and path.is_file()
