"""A picture, read safely; its shifted copies; groups of near-duplicates.

Knows pixels and files; nothing of labels, projects or models.
"""
