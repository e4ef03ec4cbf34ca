"""Models in a folder of this machine: one file a family, and what the families share.

No chat models (`vqa_state.models.chat`) and no servers (`vqa_state.models.server`).
"""
