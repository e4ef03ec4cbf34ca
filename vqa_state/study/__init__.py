"""The workflows on one open project: collect, optimize, assess, leaderboard, suggest, export.

App and command line are two thin faces of what stands here; no gradio, no typer.
"""
