"""Stand-ins for what the web tests have no patience for: photos, a model, and its slowness."""

import hashlib
import io
import threading

import numpy as np
from PIL import Image

from vqa_state.answers.answer import Answer
from vqa_state.web.jobs import Snapshot
from vqa_state.web.session import Desk


def picture(number: int, *, dark: bool) -> bytes:
    """A PNG that looks like no other number's: 8 × 8 random blocks, dark or bright."""
    rng = np.random.default_rng([number, dark])
    low, high = (0, 90) if dark else (165, 256)
    blocks = rng.integers(low, high, (8, 8, 3), dtype=np.uint8)
    data = io.BytesIO()
    Image.fromarray(blocks).resize((64, 64), Image.Resampling.NEAREST).save(data, "PNG")
    return data.getvalue()


def says(image: Image.Image, question: str) -> Answer:
    """Sees whether a picture is dark, and errs in a way of its own for each question."""
    dark = np.asarray(image.convert("L")).mean() < 128
    noise = hashlib.sha256(question.encode() + image.resize((4, 4)).tobytes()).digest()
    if noise[0] < 25:
        return Answer("not sure")
    wrong = noise[1] < len(question)
    yes = bool(dark) ^ ("closed" in question or "not" in question) ^ wrong
    return Answer("yes" if yes else "no")


class Gate:
    """Lets a model's answers through once it is open; `reached` says that one waits."""

    def __init__(self) -> None:
        self.opened, self.reached = threading.Event(), threading.Event()

    def pass_through(self) -> None:
        self.reached.set()
        assert self.opened.wait(60), "nobody opened the gate"


def finished(desk: Desk, pid: str, kind: str) -> Snapshot:
    """How the project's last job of this kind ended."""
    job = desk.jobs.get(pid, kind)
    assert job is not None
    return job.join(120)
