"""Models behind OpenAI-compatible servers: calls, retries, faults, the circuit breaker.

Nothing here loads a model.
"""
