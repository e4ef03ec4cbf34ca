"""Models of the Hugging Face hub: what is on this disk, and the process that downloads.

The only code that may download weights.
"""
