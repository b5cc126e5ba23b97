"""Latency and jitter of the loop from stylus to force."""
