"""`python -m vqa_state`."""

import os
import sys


def start() -> None:
    """Load the program and run one command; Ctrl-C while it loads ends it with a line."""
    try:
        from vqa_state.cli import main
    except KeyboardInterrupt:  # once it runs, the commands hear it themselves
        print("stopped by you while starting; nothing was changed", file=sys.stderr, flush=True)
        os._exit(130)  # sys.exit may end as by the signal, if code run by `exec` was interrupted
    main()


if __name__ == "__main__":
    start()
