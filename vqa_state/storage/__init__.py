"""Writing a file whole or not at all, and one writer at a time.

Knows bytes, paths and locks; nothing of projects, answers or models.
"""
