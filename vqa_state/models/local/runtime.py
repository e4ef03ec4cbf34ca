"""What a local model runs on, and the digest of the files that it is made of."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vqa_state.errors import ModelError
from vqa_state.models.address import Device, Precision
from vqa_state.models.local.folder_files import loaded_files
from vqa_state.models.local.image_processors import image_class

if TYPE_CHECKING:
    import torch

__all__ = ["Runtime", "choose_runtime", "folder_digest"]


@dataclass(frozen=True, slots=True)
class Runtime:
    """Where a local model runs and in what numbers; both are part of its fingerprint."""

    device: Device
    precision: Precision

    def __str__(self) -> str:
        return f"{self.device} {self.precision}"

    @property
    def dtype(self) -> "torch.dtype":
        """The precision as torch names it."""
        import torch

        return {
            Precision.FLOAT32: torch.float32,
            Precision.BFLOAT16: torch.bfloat16,
            Precision.FLOAT16: torch.float16,
        }[self.precision]


def choose_runtime(device: Device = Device.AUTO, precision: Precision = Precision.AUTO) -> Runtime:
    """The wish, with everything that it leaves open chosen for this machine.

    A processor calculates in float32, whose results are the same on every machine of a kind; a
    graphics card in the half precision that it is built for.

    Raises:
        ModelError: if this machine has no such device, or the device cannot calculate so.
    """
    import torch

    there = {
        Device.CPU: True,
        Device.CUDA: torch.cuda.is_available(),
        Device.MPS: torch.backends.mps.is_available(),
    }
    if device is Device.AUTO:
        device = next(one for one in (Device.CUDA, Device.MPS, Device.CPU) if there[one])
    if not there[device]:
        allowed = ", ".join(one for one, is_there in there.items() if is_there)
        raise ModelError(f"this machine has no device {device!s}; it has: {allowed}")
    if precision is Precision.AUTO:
        precision = {
            Device.CPU: Precision.FLOAT32,
            Device.MPS: Precision.FLOAT16,
            Device.CUDA: Precision.BFLOAT16
            # A card before Ampere only emulates bfloat16, which is slower than float16 there.
            if device is Device.CUDA and torch.cuda.is_bf16_supported(including_emulation=False)
            else Precision.FLOAT16,
        }[device]
    if device is Device.CPU and precision is Precision.FLOAT16:
        raise ModelError("a processor has no fast float16; choose float32 or bfloat16")
    return Runtime(device, precision)


def folder_digest(folder: Path) -> str:
    """First 16 hex digits of the SHA-256 of all that a folder brings into an answer.

    That is what stands in the files that are loaded, and the class that prepares its images, which
    the files do not tell: it may depend on whether torchvision is installed, and on its version.

    Raises:
        ModelError: if a file cannot be read, or the folder asks for something that is refused.
    """
    digest = hashlib.sha256()
    try:
        for path in loaded_files(folder):
            with path.open("rb") as file:
                own = hashlib.file_digest(file, "sha256").hexdigest()
            digest.update(f"{path.relative_to(folder).as_posix()} {own}\n".encode())
    except OSError as error:
        raise ModelError(
            f"cannot read the model in {folder} ({error.strerror}); check the folder"
        ) from error
    digest.update(f"images by {image_class(folder)}\n".encode())
    return digest.hexdigest()[:16]
