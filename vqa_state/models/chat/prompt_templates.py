"""How a question is put to a chat model: one template a family, or the user's own."""

__all__ = ["prompt_for"]

_QUESTION = "{question}"

#: What a model was trained to hear, by the `model_type` of its configuration.
_TEMPLATES = {
    "paligemma": "answer en {question}",  # its task prefix for questions about an image
    "blip-2": "Question: {question} Answer:",
    "instructblip": "{question} Short answer:",
}

_DEFAULT = "{question} Answer yes or no."


def prompt_for(model_type: str, own: str = "") -> str:
    """The template that a model gets; "{question}" stands in it exactly once.

    Args:
        model_type: of the model's configuration, for example "qwen2_5_vl".
        own: the user's template, or "" for the family's.

    Raises:
        ValueError: if the user's template does not hold "{question}" exactly once.
    """
    template = own or _TEMPLATES.get(model_type, _DEFAULT)
    if template.count(_QUESTION) != 1:
        raise ValueError(f"the prompt {template!r} must hold {_QUESTION} once")
    return template
