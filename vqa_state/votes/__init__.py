"""Rules that turn the answers about one image into a state, and what is learned for them.

The equal vote, thresholds, weights, the reject option, early stopping; nothing of how questions
were chosen.
"""
