"""Open the web app: `python app.py [--port 7860] [--projects DIR] [--no-browser]`."""

import os
import sys

if __name__ == "__main__":
    os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"  # read when gradio is imported: nothing leaves

    from vqa_state.web.server import main

    sys.exit(main())
