"""Chat models with images, run on this machine through transformers.

The image is read once for all questions about it; nothing here calls a server.
"""
