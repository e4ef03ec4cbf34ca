"""What the paper's tables say: another model (OFA) on other images, so nothing of ours equals it.

Source: paper III, tables I to XI.
"""

from pathlib import Path

import pandas as pd

__all__ = [
    "BEST_QUESTION_OF_VARIOUS_DOORS",
    "EXPERIMENTS",
    "REPEATED",
    "SUBSETS",
    "paper_tables",
]

#: The experiments in the paper's order; each is the name of a sample project too.
EXPERIMENTS = (
    "door",
    "elevator",
    "cabinet",
    "refrigerator",
    "various_doors",
    "microwave",
    "transparent_door",
    "light",
    "display",
    "handbag",
    "water",
)

#: Its pictures are those of the first four, so that nothing may count it as an experiment more.
REPEATED = "various_doors"

#: The rows of each table.
SUBSETS = ("s+", "s'+", "s-", "s'-", "s_does", "s_is", "s_all")

#: Images of 80 that the paper's best single question recognizes; it gives no other such figure.
BEST_QUESTION_OF_VARIOUS_DOORS = 72


def paper_tables() -> pd.DataFrame:
    """All rows of the paper's tables.

    Columns: experiment, subset, n_recognized, n_images, R_ave, R_invalid (rates in [0, 1]), n_used,
    n_questions.
    """
    frame = pd.read_csv(Path(__file__).with_name("paper_tables.csv"))
    frame["experiment"] = frame["experiment"].str.replace(" ", "_")
    return frame
