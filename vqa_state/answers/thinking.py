"""What a model thinks before it answers, and the marks by which models set it apart.

Source: the chat templates of DeepSeek-R1, Qwen3 and GLM ("<think>"), Magistral ("[THINK]"), Kimi
("◁think▷"), Seed-OSS ("<seed:think>"), EXAONE Deep ("<thought>"), Command A ("<|START_THINKING|>"),
OpenThinker ("<|begin_of_thought|>"), gpt-oss and Gemma 4 (channels) and Apertus
("<|inner_prefix|>").
"""

import re

__all__ = ["without_thinking"]

_NAMES = (
    "think|thinking|thoughts?|reason|reasoning|reflect|reflection|analysis|scratchpad|rationale|cot"
    "|chain_of_thought|inner_monologue|ant_?thinking|seed:think|seed:cot_budget_reflect"
)
_OPENS = re.compile(
    rf"[<\[◁]\s*\|?({_NAMES})\|?(?:\s[^<>\[\]◁▷]*)?[>\]▷]|<\|(?:begin_of|start)_(?:thought|thinking)\|>"
    r"|<\|channel\|?>\s*(?:analysis|commentary|thought)\b|<\|inner_prefix\|>"
)
_CLOSES = re.compile(
    rf"[<\[◁]\s*\|?/\s*({_NAMES})\|?\s*[>\]▷]|<\|end_(?:of_)?(?:thought|thinking)\|>"
    r"|<\|channel\|>\s*final\b|<channel\|>|<\|inner_suffix\|>"
)


def without_thinking(text: str) -> str:
    """The text without its thinking; `text` is in lower case.

    Thinking begins at a mark and ends at the mark of the same name, or never. What stands before a
    closing mark that nothing opened was thinking, too: some templates open it themselves.
    """
    marks = sorted(
        [(mark, True) for mark in _OPENS.finditer(text)]
        + [(mark, False) for mark in _CLOSES.finditer(text)],
        key=lambda pair: pair[0].start(),
    )
    kept, thinking, start = "", set[str | None](), 0
    for mark, opens in marks:
        kept += "" if thinking else text[start : mark.start()]
        start = mark.end()
        if opens:
            thinking.add(mark[1])
        elif mark[1] in thinking:
            thinking.discard(mark[1])
        elif not thinking:
            kept = ""
    return kept if thinking else kept + text[start:]
