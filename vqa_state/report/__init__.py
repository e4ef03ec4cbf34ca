"""What people read and print: data frames, plots, galleries, the HTML page.

Shows what `vqa_state.study` computed and computes nothing itself.
"""
