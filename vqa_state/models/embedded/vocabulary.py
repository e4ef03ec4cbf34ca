"""Every answer that the model can give; the order is that of its last layer."""

__all__ = ["ANSWERS", "NO", "YES"]

#: "yes" and "no" first; all others are what makes an answer invalid for a yes/no question.
ANSWERS = (
    "yes",
    "no",
    "open",
    "closed",
    "on",
    "off",
    "running",
    "stopped",
    "door",
    "elevator",
    "cabinet",
    "refrigerator",
    "microwave",
    "transparent door",
    "light",
    "display",
    "handbag",
    "faucet",
    "none",
    "bright",
    "dark",
    "picture",
    "water",
    "nothing",
    "drawer",
    "window",
    "curtain",
    "laptop",
    "box",
    "gate",
    "oven",
)

YES = ANSWERS.index("yes")
NO = ANSWERS.index("no")
