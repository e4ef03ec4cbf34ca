"""Token ids of many questions about one image, with the image prepared once.

A processor writes the image's own tokens into the text and turns all of it into ids. It does so
here once an image, for a question that stands for all; what follows the last image token is then
cut off and written again for each real question. As an image token is never merged with what
stands beside it, the ids are those that the processor itself would give; `splices` compares.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PIL.Image import Image

__all__ = ["ChatPrompt", "SeenImage"]

#: Stands for all questions; its own words never reach the model.
_STAND_IN = "Is this the question?"

#: Beginnings so unlike each other that what their ids share is no part of a question.
_PROBES = (_STAND_IN, "a", "Does it?", "1 of 2", "?", "what", "ähnlich", "(open)", " no")

#: Inputs with one value a token; those of text are 0 but for the mask.
_BY_TOKEN = {"attention_mask": 1, "token_type_ids": 0, "mm_token_type_ids": 0}


@dataclass(frozen=True, eq=False)
class SeenImage:
    """What the processor made of an image.

    Attributes:
        inputs: the model's inputs, for the question that stands for all.
        head: ids before the last image token; empty if the text cannot be cut.
        before, after: text between the last image token and the question's part, and behind it.
    """

    inputs: dict[str, Any]
    head: tuple[int, ...] = ()
    before: str = ""
    after: str = ""

    @property
    def form(self) -> tuple[object, ...]:
        """Equal for images whose inputs can be put together along their first axis."""
        shapes = (
            (key, tuple(value.shape[1:])) if hasattr(value, "shape") else object()
            for key, value in self.inputs.items()
        )
        return (len(self.head), *shapes)


class ChatPrompt:
    """Puts questions into a template and the template into the model's chat format."""

    def __init__(self, processor: Any, config: Any, template: str) -> None:
        """Keep what belongs together.

        Args:
            processor: of transformers, for images and text.
            config: the model's configuration.
            template: with "{question}" once.
        """
        self._processor = processor
        self._tokenizer = processor.tokenizer
        self._template = template
        self._is_chat = bool(getattr(processor, "chat_template", None))
        self._written = getattr(processor, "image_token", None)
        ids = (getattr(config, key, None) for key in ("image_token_id", "image_token_index"))
        self.image_token: int | None = next((one for one in ids if isinstance(one, int)), None)

    def plain(self, image: Image, question: str) -> dict[str, Any]:
        """The model's inputs as the processor gives them, tensors with a batch of one.

        Raises:
            ValueError, RuntimeError: if the processor refuses the image.
        """
        text = self._template.replace("{question}", question)
        if self._is_chat:
            inputs = self._processor.apply_chat_template(
                _message(text, image),
                add_generation_prompt=True,
                tokenize=True,
                return_dict=True,
                return_tensors="pt",
            )
        else:
            inputs = self._processor(
                text=[(self._written or "") + text], images=[image], return_tensors="pt"
            )
        return {key: value for key, value in inputs.items() if key != "labels"}

    def see(self, image: Image) -> SeenImage:
        """Prepare an image for all questions.

        Raises:
            ValueError, RuntimeError: if the processor refuses the image.
        """
        inputs = self.plain(image, _STAND_IN)
        ids = inputs["input_ids"][0].tolist()
        if self._written is None or self.image_token not in ids:
            return SeenImage(inputs)
        last = len(ids) - 1 - ids[::-1].index(self.image_token)
        tail = self._tokenizer.decode(
            ids[last:], skip_special_tokens=False, clean_up_tokenization_spaces=False
        )
        behind = self._behind_image(_STAND_IN)
        if not behind or behind not in tail or self._ids(tail) != ids[last:]:
            return SeenImage(inputs)
        before, _, after = tail.partition(behind)
        return SeenImage(inputs, tuple(ids[:last]), before, after)

    def ids(self, seen: SeenImage, question: str) -> list[int]:
        """All ids of a question about an image that could be cut."""
        tail = self._ids(seen.before + self._behind_image(question) + seen.after)
        return [*seen.head, *tail]

    def n_shared(self, seen: SeenImage) -> int:
        """How many of the first ids are the same for every question."""
        rows = [self.ids(seen, probe) for probe in _PROBES]
        alike = (len(set(column)) == 1 for column in zip(*rows, strict=False))
        return next((n for n, same in enumerate(alike) if not same), 0)

    def inputs(self, seen: SeenImage, ids: Sequence[int]) -> dict[str, Any]:
        """The model's inputs for these ids: those of a question, or their beginning."""
        import torch

        made = dict(seen.inputs)
        made["input_ids"] = torch.tensor([list(ids)])
        for key, value in _BY_TOKEN.items():
            if key in made:
                row = made[key][:, : len(seen.head) + 1]  # behind the image all is text
                filled = row.new_full((1, max(0, len(ids) - row.shape[1])), value)
                made[key] = torch.cat([row, filled], 1)
        return made

    def splices(self, image: Image, questions: Sequence[str]) -> bool:
        """Whether all inputs made by cutting equal the processor's own."""
        seen = self.see(image)
        if not seen.head or not 0 < len(seen.head) < self.n_shared(seen):
            return False
        return all(
            _same(self.inputs(seen, self.ids(seen, one)), self.plain(image, one))
            for one in questions
        )

    def _behind_image(self, question: str) -> str:
        text = self._template.replace("{question}", question)
        if not self._is_chat:
            return text
        written = self._processor.apply_chat_template(
            _message(text), add_generation_prompt=True, tokenize=False
        )
        return str(written.partition(self._written)[2])

    def _ids(self, text: str) -> list[int]:
        return list(self._tokenizer(text, add_special_tokens=False).input_ids)


def _message(text: str, image: Image | None = None) -> list[dict[str, Any]]:
    # The image comes first: what stands behind it must not change what it is turned into.
    seen = {"type": "image"} if image is None else {"type": "image", "image": image}
    return [{"role": "user", "content": [seen, {"type": "text", "text": text}]}]


def _same(ours: dict[str, Any], theirs: dict[str, Any]) -> bool:
    return ours.keys() == theirs.keys() and all(
        ours[key].shape == value.shape and bool((ours[key] == value).all())
        if hasattr(value, "shape")
        else ours[key] == value
        for key, value in theirs.items()
    )
