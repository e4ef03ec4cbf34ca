"""The exported JSON recognizer: its schema, asking its questions about one image, its verdict.

Runs without a project.
"""
