"""The paper's eleven experiments on the sample projects, beside the paper's own numbers."""
