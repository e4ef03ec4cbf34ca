"""What a model said: raw text → yes, no or invalid → arrays of answers, their store, their rates.

Knows nothing of how an answer was bought, and nothing of choosing questions.
"""
