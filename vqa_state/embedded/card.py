"""The tables of docs/embedded_model.md, made from docs/embedded_model.json."""

from collections.abc import Mapping
from typing import Any

__all__ = ["BEGIN", "END", "tables", "with_tables"]

#: What stands between these lines of the card is written by `evaluate`.
BEGIN = "<!-- measured: begin -->"
END = "<!-- measured: end -->"


def tables(numbers: Mapping[str, Any]) -> str:
    """Both tables and the facts about the file, as Markdown."""
    return "\n".join(
        [_facts(numbers["file"]), "", *_scenes(numbers["scenes"]), "", *_photos(numbers["photos"])]
    )


def with_tables(card: str, numbers: Mapping[str, Any]) -> str:
    """The card with its measured part replaced.

    Raises:
        ValueError: if the card lacks one of the two marks.
    """
    before, begin, rest = card.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the card must hold {BEGIN!r} and {END!r}")
    return f"{before}{BEGIN}\n{tables(numbers)}\n{END}{after}"


def _facts(file: Mapping[str, Any]) -> str:
    training = file["training"]
    return (
        f"Training: seed {training['seed']}, {training['scenes']} rendered pictures, "
        f"{training['photos']} variations of photos, {training['epochs']} epochs. "
        f"Weights: {file['megabytes']} MB, {file['parameters']:,} parameters in float16, SHA-256 "
        f"starts with `{file['digest']}`. "
        f"120 pictures with 64 questions each: {file['seconds_120x64']} s on {file['threads']} "
        "processor threads."
    )


def _scenes(rows: list[Mapping[str, Any]]) -> list[str]:
    lines = [
        "| scenes | recognized, s+ | of each state | recognized, all | questions used "
        "| invalid | single question: worst / median / best |",
        "|---|---|---|---|---|---|---|",
    ]
    return lines + [
        f"| {row['thing'].replace('_', ' ')} | {row['s_plus']} of {row['n_test']} "
        f"| {row['positive']} + {row['negative']} | {row['s_all']} "
        f"| {row['n_used']} of {row['n_questions']} | {row['invalid']:.1%} "
        f"| {row['single_min']:.3f} / {row['single_median']:.3f} / {row['single_max']:.3f} |"
        for row in rows
    ]


def _photos(rows: list[Mapping[str, Any]]) -> list[str]:
    lines = [
        "| photos | open | closed | balanced, all | balanced, s+ of the scenes | invalid |",
        "|---|---|---|---|---|---|",
    ]
    return lines + [
        f"| {row['thing']} | {row['positive']} of {row['n_positive']} "
        f"| {row['negative']} of {row['n_negative']} | {row['balanced']:.3f} "
        f"| {row['s_plus_balanced']:.3f} | {row['invalid']:.1%} |"
        for row in rows
    ]
