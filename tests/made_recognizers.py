"""A recognizer of three questions about a door, and a model to answer them."""

from vqa_state.answers.answer import Answer
from vqa_state.images.augmentation import AugmentationKind
from vqa_state.recognizer.recognizer import (
    Copies,
    ModelReference,
    Origin,
    Recognizer,
    ScoreRecord,
    Scores,
    States,
    WeightedQuestion,
)
from vqa_state.search.genetic import SearchSettings
from vqa_state.search.objectives import Objective, ObjectiveWeights
from vqa_state.testing.fake_model import ScriptedModel

QUESTIONS = ("Is this door open?", "Is this door closed?", "Is the inside visible?")


def recognizer(**changes) -> Recognizer:
    record = ScoreRecord(n_recognized=9, n_images=10, R_ave=0.8, R_invalid=0.1)
    fields = {
        "name": "door",
        "states": States(positive="open", negative="closed"),
        "model": ModelReference(name="scripted", fingerprint="scripted/1"),
        "copies": Copies(kind=AugmentationKind.RGB_SHIFT, amount=0.1, n_copies=2, seed=0),
        "questions": (
            WeightedQuestion(text=QUESTIONS[0], yes_means=1),
            WeightedQuestion(text=QUESTIONS[1], yes_means=-1),
            WeightedQuestion(text=QUESTIONS[2], yes_means=1),
        ),
        "origin": Origin(
            objective=Objective.S_PLUS,
            weights=ObjectiveWeights(),
            settings=SearchSettings(),
            seed=0,
            generations=200,
            finished=True,
        ),
        "scores": Scores(train=record, test=None),
        "calls_per_image": 6,
    }
    return Recognizer(**(fields | changes))


def saying(**said: str) -> ScriptedModel:
    texts = dict(zip(QUESTIONS, said.values(), strict=True))
    return ScriptedModel(lambda _, question: Answer(texts[question]))
