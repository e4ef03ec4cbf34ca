"""The small VQA model that ships with the package: its network and its weights.

Only what runs; what made it is `vqa_state.embedded_training`.
"""
