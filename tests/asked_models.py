"""Models that a test writes down, and asking to the end."""

from dataclasses import dataclass

import numpy as np

from vqa_state.answers.answer import Answer
from vqa_state.images import pixel_hash
from vqa_state.models import Reply
from vqa_state.project.split import Split
from vqa_state.study.collect import answer_table, ask, plan

N_CALLS = 6 * 2 * 16


def telling(image, question):
    """An answer that depends on the picture and the question, now and then invalid."""
    value = int(pixel_hash(image)[:8], 16) ^ len(question) * 2654435761
    text = ("yes", "no", "hard to say")[value % 3]
    return Answer(text, (value % 101) / 100 if value % 2 else None)


@dataclass
class Model:
    """A model whose replies a test writes down whole."""

    reply: object
    name: str = "written"
    fingerprint: str = "written/1"

    def answer(self, images, questions):
        return self.reply(images, questions)


def every(images, questions):
    for i in range(len(images)):
        for q in range(len(questions)):
            yield Reply(i, q, Answer("yes"))


def finish(project, model, **options):
    """Ask to the end; every report on the way must add up, and be in the store already."""
    last = None
    for report in ask(project, model, **options):
        assert report.n_stored + report.n_asked + report.n_failed + report.n_left == report.n_calls
        assert min(report.n_stored, report.n_asked, report.n_failed, report.n_left) >= 0
        if report.n_asked + report.n_failed == 0:
            assert report.seconds_left is None
        else:
            assert report.seconds_left >= 0
        assert last is None or report.n_asked >= last.n_asked
        assert plan(project, model.fingerprint).n_stored == report.n_stored + report.n_asked
        last = report
    project.fingerprint = model.fingerprint
    return last


def tables(project):
    return [answer_table(project, split) for split in (Split.TRAIN, Split.TEST)]


def same(one, other):
    return all(
        a.image_ids == b.image_ids
        and a.questions == b.questions
        and (a.verdicts == b.verdicts).all()
        and np.array_equal(a.p_positive, b.p_positive, equal_nan=True)
        and (a.labels == b.labels).all()
        for a, b in zip(one, other, strict=True)
    )
