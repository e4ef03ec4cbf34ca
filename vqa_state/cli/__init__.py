"""`python -m vqa_state`: the same road as the app, without a browser.

Exit codes: 0 it went well; 1 something must be changed first (the message says what); 2 the
command was typed wrong; 3 it ended early, an answer is missing or a verdict is unknown.
"""

import io
import sys

from vqa_state.cli import choosing, making, opening, reproducing, running, using
from vqa_state.cli.options import app
from vqa_state.cli.terminal import say
from vqa_state.errors import EXTRAS, MissingAnswersError, MissingExtraError, VQAStateError

__all__ = ["app", "choosing", "main", "making", "opening", "reproducing", "running", "using"]


def main() -> None:
    """Run one command; an error of ours is shown as a sentence."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a file's name may be no text at all
    try:
        app()
    except VQAStateError as error:
        say(f"error: {error}")
        sys.exit(3 if isinstance(error, MissingAnswersError) else 1)
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise  # our own mistake
        say(f"error: {MissingExtraError('this command', package)}")
        sys.exit(1)
