"""OFA, the model of the paper, in plain PyTorch; nothing is loaded before it is used.

Source: P. Wang et al., *OFA: Unifying Architectures, Tasks, and Modalities Through a Simple
Sequence-to-Sequence Learning Framework*, ICML 2022, arXiv 2202.03052.
"""
