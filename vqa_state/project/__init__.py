"""The folder on disk: project.json, images and their import, the split, kept searches.

Asks no model and searches nothing.
"""
