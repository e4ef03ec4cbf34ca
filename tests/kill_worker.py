"""Asks a project's questions slowly and writes every call to a file; `test_kill.py` kills it.

Arguments: the project's folder, the file of calls, seconds a call.
"""

import os
import sys
import time
from pathlib import Path

from vqa_state.answers.answer import Answer
from vqa_state.images import pixel_hash
from vqa_state.project.project import Project
from vqa_state.study.collect import ask
from vqa_state.testing.fake_model import ScriptedModel


def answer(image, question):
    """Yes, no or neither, by the pixels and the question."""
    value = int(pixel_hash(image)[:8], 16) ^ len(question) * 2654435761
    return Answer(("yes", "no", "hard to say")[value % 3], value % 101 / 100)


def main(folder, calls, seconds):
    with Path(calls).open("a") as log:

        def slowly(image, question):
            log.write(f"{pixel_hash(image)}\t{question}\n")
            log.flush()
            os.fsync(log.fileno())
            time.sleep(float(seconds))
            return answer(image, question)

        for _ in ask(Project.open(Path(folder)), ScriptedModel(slowly)):
            pass


if __name__ == "__main__":
    main(*sys.argv[1:])
