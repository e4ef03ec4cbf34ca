"""Choose the questions that let a vision-language model recognize a state."""

__version__ = "0.1.0"
