"""Choosing questions: objectives, genetic and exact search, proofs. Each yields frozen reports.

The only package that knows deap and ortools; it sees counts of answers, never images or models.
"""
