"""The Optimize panel keeps the whole sentence of a badge after the proof."""

import pytest

from vqa_state.recognizer.schema import ProofRecord
from vqa_state.search.proof import Badge
from vqa_state.web.tabs import optimize


@pytest.mark.parametrize(
    ("badge", "bound", "n_bound", "sentence"),
    [
        (Badge.IMAGES, 95.9133, 19, "most images proved, E within 0.12 of the bound"),
        (Badge.FOUND, 101.1, 20, "best found, bound 20"),
        (Badge.BEST, 95.8, 19, "proved best"),
    ],
)
def test_the_kept_proof_says_its_whole_sentence(badge, bound, n_bound, sentence):
    record = ProofRecord(badge=badge, value=95.8, bound=bound, n_bound=n_bound, stopped=False)
    assert optimize.proved(record) == [
        ["proof", sentence],
        ["no E is above", f"{bound:.3f}"],
    ]
