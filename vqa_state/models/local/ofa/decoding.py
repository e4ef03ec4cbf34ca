"""How an answer is found: by beam search, or as the best of given answers.

Source: fairseq's sequence generator with plain beam search, as OFA uses it; for given answers
OFA's "all candidates" evaluation, where each step chooses among the answers' next tokens only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from vqa_state.models.local.ofa.network import Decoder, Encoded, Said
from vqa_state.models.local.ofa.tokenizer import EOS, PAD

__all__ = ["BeamSearch", "Found", "beam_search", "best_answer", "start"]

#: Given answers that are scored together.
_MAX_ANSWERS = 64


@dataclass(frozen=True, slots=True)
class BeamSearch:
    """Settings of the search; the defaults are those of OFA's VQA evaluation, but for the length.

    Attributes:
        size: hypotheses that are followed, and that must have ended.
        max_length: tokens of an answer, its end not counted.
        min_length: tokens before the end may come; the decoder's prompt counts.
        length_penalty: a sum of log-probabilities is divided by (length ** this).
        no_repeat_ngram: no n tokens in a row twice; 0 switches it off.
    """

    size: int = 5
    max_length: int = 30
    min_length: int = 1
    length_penalty: float = 0.0
    no_repeat_ngram: int = 0


@dataclass(frozen=True, slots=True)
class Found:
    """An answer's tokens, without its end, and its score."""

    tokens: tuple[int, ...]
    score: float


def start(decoder: Decoder, encoded: Encoded, prompts: Tensor) -> tuple[Said, Tensor]:
    """Let the decoder read its prompts (n_questions, n_prompt), which begin with BOS.

    Returns:
        What it keeps, and the logits of an answer's first token (n_questions, vocab_size).
    """
    said = decoder.begin(encoded)
    return said, decoder.score_words(decoder(prompts, said)[:, -1])


def beam_search(
    decoder: Decoder, said: Said, logits: Tensor, prompts: Tensor, settings: BeamSearch
) -> list[list[Found]]:
    """Each question's best answers, best first, at most `settings.size` of them.

    Args:
        decoder: that made `said` and `logits` in `start`.
        said: changed by the search.
        logits: of the first token, (n_questions, vocab_size).
        prompts: that it has read, (n_questions, n_prompt).
        settings: of the search.
    """
    n, size = len(prompts), settings.size
    found: list[list[Found]] = [[] for _ in range(n)]
    tokens = prompts[:, None]  # (n_questions, n_rows, n_words), one row before the first step
    scores = torch.zeros(n, 1, device=logits.device)
    logits = logits[:, None]
    for step in range(settings.max_length + 1):
        steps = torch.log_softmax(logits, dim=-1)
        _forbid(steps, tokens, step, prompts.shape[1], settings)
        best, rows, words = _best(scores[..., None] + steps, 2 * size)
        ends = (words == EOS) & best.isfinite()
        _collect(found, tokens[..., prompts.shape[1] :], (best, rows, ends), settings)
        if step == settings.max_length or all(len(answers) == size for answers in found):
            break
        # Of 2 * size candidates at most `size` end, one a row; the best of the others go on.
        order = torch.arange(2 * size, device=words.device) + ends * 2 * size
        chosen = torch.topk(order, size, dim=1, largest=False).indices
        scores, rows, words = (x.gather(1, chosen) for x in (best, rows, words))
        kept = torch.arange(n, device=rows.device)[:, None] * tokens.shape[1] + rows
        tokens = torch.cat([tokens.flatten(0, 1)[kept], words[..., None]], dim=2)
        said.choose_rows(kept.flatten())
        x = decoder(words.reshape(-1, 1), said)
        logits = decoder.score_words(x[:, -1]).reshape(n, size, -1)
    return [sorted(answers, key=lambda answer: -answer.score) for answers in found]


def best_answer(
    decoder: Decoder, said: Said, logits: Tensor, answers: Sequence[Sequence[int]]
) -> Tensor:
    """How well each given answer fits each question.

    Args:
        decoder: that made `said` and `logits` in `start`.
        said: of the questions; left as it was.
        logits: of the first token, (n_questions, vocab_size).
        answers: tokens of each, without an end.

    Returns:
        Log-probabilities among these answers, (n_questions, n_answers).
    """
    following = _following(answers)
    scores = torch.zeros(len(logits), len(answers), device=logits.device)
    for begin in range(0, len(answers), _MAX_ANSWERS):
        some = answers[begin : begin + _MAX_ANSWERS]
        states = _answer_states(decoder, said, some)
        for number, answer in enumerate(some):
            for place, token in enumerate([*answer, EOS]):
                allowed = following[tuple(answer[:place])]
                if len(allowed) > 1:  # else there is no choice
                    among = (
                        decoder.score_words(states[:, number, place - 1], allowed)
                        if place
                        else logits[:, allowed]
                    )
                    chosen = among.log_softmax(dim=-1)[:, allowed.index(token)]
                    scores[:, begin + number] += chosen
    return scores


def _answer_states(decoder: Decoder, said: Said, answers: Sequence[Sequence[int]]) -> Tensor:
    """The decoder after every word of every answer: (n_questions, n_answers, longest, width)."""
    n, longest = len(said.encoded[0][0]), max(map(len, answers))
    padded = [[*answer, *[PAD] * (longest - len(answer))] for answer in answers]
    device = said.cross_keys.device
    words = torch.tensor(padded, device=device).repeat(n, 1)  # pads come last: no word sees them
    rows = Said(said.encoded, said.cross_keys, said.rows, said.n_words)
    rows.choose_rows(torch.arange(n, device=device).repeat_interleave(len(answers)))
    states: Tensor = decoder(words, rows)
    return states.reshape(n, len(answers), longest, -1)


def _following(answers: Sequence[Sequence[int]]) -> dict[tuple[int, ...], list[int]]:
    """For each beginning of an answer, the tokens that may come next."""
    following: dict[tuple[int, ...], set[int]] = {}
    for answer in answers:
        for place, token in enumerate([*answer, EOS]):
            following.setdefault(tuple(answer[:place]), set()).add(token)
    return {beginning: sorted(tokens) for beginning, tokens in following.items()}


def _forbid(steps: Tensor, tokens: Tensor, step: int, n_prompt: int, settings: BeamSearch) -> None:
    """Take the chance from tokens that may not come now; changes `steps`."""
    steps.masked_fill_(steps.isnan(), -torch.inf)
    steps[..., PAD] = -torch.inf
    if n_prompt - 1 + step < settings.min_length:
        steps[..., EOS] = -torch.inf
    if step == settings.max_length:
        end = steps[..., EOS].clone()
        steps.fill_(-torch.inf)
        steps[..., EOS] = end
    n = settings.no_repeat_ngram
    if n:
        for steps_row, row in zip(steps.flatten(0, 1), tokens.flatten(0, 1).tolist(), strict=True):
            steps_row[_repeats(row, n)] = -torch.inf


def _repeats(row: list[int], n: int) -> list[int]:
    """Tokens that would end a run of n tokens that the row already has."""
    last = row[len(row) - n + 1 :]
    starts = range(len(row) - n + 1)
    return [row[i + n - 1] for i in starts if row[i : i + n - 1] == last]


def _best(scores: Tensor, n_best: int) -> tuple[Tensor, Tensor, Tensor]:
    """The best continuations of a question's rows: score, row and token, each (n, n_best)."""
    vocab_size = scores.shape[-1]
    best, places = torch.topk(scores.flatten(1), n_best)
    return best, places // vocab_size, places % vocab_size


def _collect(
    found: list[list[Found]],
    tokens: Tensor,
    candidates: tuple[Tensor, Tensor, Tensor],
    settings: BeamSearch,
) -> None:
    """Keep the answers that end here; a question needs no more than `settings.size`."""
    best, rows, ends = candidates
    length = tokens.shape[-1] + 1
    for question, candidate in ends[:, : settings.size].nonzero().tolist():
        if len(found[question]) < settings.size:
            answer = tokens[question, rows[question, candidate]].tolist()
            score = float(best[question, candidate]) / length**settings.length_penalty
            found[question].append(Found(tuple(answer), score))
