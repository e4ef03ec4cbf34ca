"""`python -m vqa_state`."""

from vqa_state.cli import main

if __name__ == "__main__":
    main()
