"""What is asked: wordings, the names and phrases of the two states, the grid, ready cues.

Knows texts and which state "yes" speaks for; no model and no answer.
"""
