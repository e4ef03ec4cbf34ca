"""Measurements that documents quote. Each module runs by itself: `python -m benchmarks.search`."""
