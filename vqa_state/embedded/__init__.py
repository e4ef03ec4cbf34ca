"""The small VQA model that ships with the package, and the code that made it."""
