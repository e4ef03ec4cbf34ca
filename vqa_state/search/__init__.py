"""Choosing questions: each search yields frozen reports, and the caller draws or stops."""
