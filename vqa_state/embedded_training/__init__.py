"""What made the embedded model: scenes, training, measuring. Nothing else imports it.

For development; its commands are in docs/embedded_model.md.
"""
