"""Validation of the simulated participants against the paper and against other measurements."""
