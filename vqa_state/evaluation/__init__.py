"""How good a choice is: held-out table, out-of-bag estimate, intervals, paired tests, linear probe.

Arithmetic on arrays; files and projects are those of `vqa_state.study`.
"""
