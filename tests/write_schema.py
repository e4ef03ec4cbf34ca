"""Write docs/recognizer.schema.json: `python -m tests.write_schema`."""

import json
from pathlib import Path

from vqa_state.recognizer.recognizer import Recognizer

if __name__ == "__main__":
    path = Path(__file__).parent.parent / "docs" / "recognizer.schema.json"
    path.write_text(json.dumps(Recognizer.model_json_schema(), indent=1) + "\n")
