"""The process that downloads: `python -m vqa_state.models.hub.download OWNER/NAME [REVISION]`.

It prints one line of JSON with the size and the place, and a last one with an error, if any. It
ends when its standard input does: whoever began it holds the other end, and may be killed.
"""

import json
import os
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["main", "wanted"]

_ENDINGS = (".json", ".txt", ".jinja", ".model")
_WEIGHTS = ".safetensors"
_OLD_WEIGHTS = "pytorch_model.bin"


def wanted(sizes: dict[str, int]) -> list[str]:
    """The files to bring, weights last, so that a folder with weights is a whole one.

    Only files at the top: below stand other formats. Old weights come only if there are no others.
    """
    top = [name for name in sorted(sizes) if "/" not in name]
    words = [name for name in top if name.endswith(_ENDINGS)]
    weights = [name for name in top if name.endswith(_WEIGHTS)]
    return words + (weights or [name for name in top if name == _OLD_WEIGHTS])


def main(arguments: Sequence[str]) -> int:
    """Download; the exit code is 1 after an error."""
    from huggingface_hub import HfApi, constants, hf_hub_download
    from huggingface_hub.errors import HfHubHTTPError, HFValidationError

    name, revision = arguments[0], arguments[1] if len(arguments) > 1 else ""
    try:
        info = HfApi().model_info(name, revision=revision or None, files_metadata=True)
        sizes = {one.rfilename: one.size or 0 for one in info.siblings or []}
        files = wanted(sizes)
        folder = Path(constants.HF_HUB_CACHE) / f"models--{name.replace('/', '--')}"
        _print(total=sum(sizes[file] for file in files), folder=str(folder))
        for file in files:
            # The branch is named, not its commit, so that the cache knows what is newest.
            hf_hub_download(name, file, revision=revision or None)
    except (HfHubHTTPError, HFValidationError) as error:
        _print(error=_refusal(name, error))
        return 1
    except Exception as error:  # noqa: BLE001 - the process's edge; its network library may change
        _print(
            error=f"cannot download {name} ({type(error).__name__}: {str(error)[:200]}); check the "
            "network and the free disk space, then start again: what came is kept"
        )
        return 1
    return 0


def _refusal(name: str, error: Exception) -> str:
    status = getattr(getattr(error, "response", None), "status_code", None)
    if status in (401, 403):
        return (
            f"the hub does not give {name} to everybody: accept its licence on its page, then set "
            "HF_TOKEN to a token of yours and start again"
        )
    if status == 404:
        return f"the hub has no model {name}; check its name and revision"
    return f"the hub gave no answer about {name} (status {status}); try again later"


def _end_with_parent() -> None:
    """The system closes the pipe of a process that is gone, however it went."""
    while os.read(0, 1):  # not sys.stdin: its lock would be held when the interpreter ends
        pass
    os._exit(1)  # a download in flight would hold up a milder end; what came is kept


def _print(**content: Any) -> None:
    print(json.dumps(content), flush=True)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.exit(main(sys.argv[1:]))
