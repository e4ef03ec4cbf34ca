"""How a program asks without us: one question a call, the image read anew for every one."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL.Image import Image

from vqa_state.models.chat.prefix_cache import N_TOKENS
from vqa_state.models.chat.prompt_templates import prompt_for
from vqa_state.models.local.blip import MAX_ANSWER_TOKENS

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["Ask", "Asked", "plain_blip", "plain_chat", "plain_vilt"]


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """What was said to one question.

    Attributes:
        answer: tokens without start and end, the number of a label, or a text.
        logits: of the first step, (n_tokens,), or of the labels.
    """

    answer: tuple[int, ...] | str
    logits: "Tensor"


Ask = Callable[[Image, str], Asked]

_GREEDY: dict[str, Any] = {
    "do_sample": False,
    "output_logits": True,
    "return_dict_in_generate": True,
}


def plain_blip(folder: Path) -> Ask:
    """`generate` of BLIP, as its page on the hub shows it."""
    from transformers import AutoProcessor, BlipForQuestionAnswering

    processors: Any = AutoProcessor
    processor = processors.from_pretrained(folder, backend="pil")
    model: Any = BlipForQuestionAnswering.from_pretrained(folder)
    end = model.config.text_config.sep_token_id

    def ask(image: Image, question: str) -> Asked:
        inputs = processor(images=image, text=question, return_tensors="pt")
        made: Any = model.generate(**inputs, max_new_tokens=MAX_ANSWER_TOKENS, **_GREEDY)
        return Asked(_until(made.sequences[0, 1:].tolist(), end), made.logits[0][0])

    return ask


def plain_vilt(folder: Path) -> Ask:
    """One forward of ViLT."""
    import torch
    from transformers import AutoProcessor, ViltForQuestionAnswering

    processors: Any = AutoProcessor
    processor = processors.from_pretrained(folder, backend="pil")
    model = ViltForQuestionAnswering.from_pretrained(folder)

    def ask(image: Image, question: str) -> Asked:
        with torch.inference_mode():
            inputs = processor(images=image, text=question, return_tensors="pt")
            logits = model(**inputs).logits[0]
        return Asked((int(logits.argmax()),), logits)

    return ask


def plain_chat(folder: Path) -> Ask:
    """`apply_chat_template` and `generate`, as every model's page on the hub shows it."""
    from transformers import AutoImageProcessor, AutoModelForImageTextToText, AutoProcessor

    processors: Any = AutoProcessor
    images: Any = AutoImageProcessor
    processor = processors.from_pretrained(folder)
    processor.image_processor = images.from_pretrained(folder, backend="pil")
    model: Any = AutoModelForImageTextToText.from_pretrained(folder)
    template, end = prompt_for(model.config.model_type), model.generation_config.eos_token_id

    def ask(image: Image, question: str) -> Asked:
        text = template.replace("{question}", question)
        content = [{"type": "image", "image": image}, {"type": "text", "text": text}]
        inputs = processor.apply_chat_template(
            [{"role": "user", "content": content}],
            add_generation_prompt=True,
            tokenize=True,
            return_dict=True,
            return_tensors="pt",
        )
        made = model.generate(**inputs, max_new_tokens=N_TOKENS, **_GREEDY)
        said = made.sequences[0, inputs["input_ids"].shape[1] :].tolist()
        return Asked(_until(said, end), made.logits[0][0])

    return ask


def _until(said: list[int], end: int) -> tuple[int, ...]:
    return tuple(said[: said.index(end)] if end in said else said)
