"""How the answers about an image become one vote: the paper's way, and ways learned from labels."""
