"""Scripts, budgets and askers that the tests of a server's model share."""

from pictures import draw
from stub_server import Result, good

from vqa_state.models.server.model import CallBudget, ServerModel

QUICK = CallBudget(
    retries=2, deadline_seconds=5.0, first_wait_seconds=0.01, longest_wait_seconds=0.3
)
IMAGES = (draw(0),)
IMPATIENT = CallBudget(retries=1, deadline_seconds=0.2, first_wait_seconds=0.01)


def model_of(stub, budget=QUICK, model="m", prompt=""):
    return ServerModel(stub.url, model, f"server:{stub.url}#{model}", prompt, budget=budget)


def outcomes(model, questions=("good", "bad"), images=IMAGES):
    """(image, question) -> outcome; every pair must come exactly once."""
    replies = list(model.answer(images, questions))
    found = {(reply.image, questions[reply.question]): reply.outcome for reply in replies}
    assert len(found) == len(replies) == len(images) * len(questions)
    return found


def only_bad(script):
    """A script for the question "bad"; all others are answered."""

    def chosen(call, handler):
        return script(call, handler) if call.question.startswith("bad") else good(call, handler)

    return chosen


def cut_off(call, handler):
    handler.head(200, 10_000)
    handler.wfile.write(b'{"choices": [')
    handler.wfile.flush()
    handler.reset()


def hang(call, handler):
    handler.connection.recv(1)  # until the caller goes away


def answers(body, status=200, **headers):
    return lambda call, handler: Result(body, status, headers)


def error(status, message="no"):
    return answers({"error": {"message": message}}, status)
