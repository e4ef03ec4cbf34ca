"""Open the web app: `python app.py [--port 7860] [--projects DIR] [--no-browser]`."""

import os
import sys


def start() -> None:
    """Load the app and serve it; Ctrl-C while it loads ends it with a line."""
    os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"  # read when gradio is imported: nothing leaves
    try:
        from vqa_state.web.server import main
    except KeyboardInterrupt:
        print("stopped by you while starting; nothing was changed", file=sys.stderr, flush=True)
        os._exit(130)
    sys.exit(main())


if __name__ == "__main__":
    start()
