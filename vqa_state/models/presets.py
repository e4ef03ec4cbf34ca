"""Models to begin with. Sizes and licences as their publishers state them; see docs/models.md."""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Final

__all__ = ["PRESETS", "Preset"]


@dataclass(frozen=True, slots=True)
class Preset:
    """A model on the hub that is known to suit.

    Attributes:
        address: what `models.create` takes.
        title: what a person reads.
        parameters: millions of weights, about; with four bytes each they fill the memory in
            float32, with two in half precision.
        licence: of the weights.
        needs: packages beside requirements.txt.
        remark: what else to know, or "".
    """

    address: str
    title: str
    parameters: int
    licence: str
    needs: tuple[str, ...] = ()
    remark: str = ""

    def megabytes(self, bytes_a_weight: int = 4) -> int:
        """Memory for the weights alone."""
        return self.parameters * bytes_a_weight

    @property
    def wants_gpu(self) -> bool:
        """Whether a processor needs minutes an image for it."""
        return self.parameters > 1500

    @property
    def missing(self) -> tuple[str, ...]:
        """Those of the packages that it needs which are not installed here."""
        return tuple(name for name in self.needs if find_spec(name) is None)

    @property
    def requirements(self) -> str:
        """What it needs beside memory, for the user; "" if nothing."""
        words = ["wants a GPU: on a processor it takes minutes an image"] if self.wants_gpu else []
        if self.missing:
            command = f"pip install {' '.join(self.missing)}"
            words.append(f"needs {', '.join(self.missing)}, not installed here: {command}")
        elif self.needs:
            words.append(f"needs {', '.join(self.needs)}, installed here")
        return "; ".join(words)


_VIDEO: Final = ("torchvision",)

PRESETS: Final = (
    Preset("hub:Salesforce/blip-vqa-base", "BLIP VQA base", 385, "BSD-3-Clause"),
    Preset("hub:Salesforce/blip-vqa-capfilt-large", "BLIP VQA large", 385, "BSD-3-Clause"),
    Preset("hub:dandelin/vilt-b32-finetuned-vqa", "ViLT B/32 VQA", 118, "Apache-2.0"),
    Preset(
        "hub:HuggingFaceTB/SmolVLM-256M-Instruct",
        "SmolVLM 256M",
        256,
        "Apache-2.0",
        remark="an Idefics3 model: needs nothing more",
    ),
    Preset("hub:HuggingFaceTB/SmolVLM-500M-Instruct", "SmolVLM 500M", 507, "Apache-2.0"),
    Preset(
        "hub:HuggingFaceTB/SmolVLM2-2.2B-Instruct",
        "SmolVLM2 2.2B",
        2200,
        "Apache-2.0",
        (*_VIDEO, "num2words"),
    ),
    Preset("hub:Qwen/Qwen3-VL-2B-Instruct", "Qwen3-VL 2B", 2100, "Apache-2.0", _VIDEO),
    Preset("hub:Qwen/Qwen3-VL-4B-Instruct", "Qwen3-VL 4B", 4400, "Apache-2.0", _VIDEO),
    Preset("hub:Qwen/Qwen2.5-VL-7B-Instruct", "Qwen2.5-VL 7B", 8300, "Apache-2.0", _VIDEO),
    Preset("hub:OpenGVLab/InternVL3-1B-hf", "InternVL3 1B", 940, "see its page", _VIDEO),
    Preset(
        "hub:google/gemma-3-4b-it",
        "Gemma 3 4B",
        4300,
        "Gemma",
        _VIDEO,
        "accept its licence on the hub first",
    ),
    Preset(
        "hub:OFA-Sys/OFA-base",
        "OFA base, the paper's model family",
        182,
        "Apache-2.0",
        remark="pretrained; the paper used a VQA-tuned checkpoint",
    ),
)
