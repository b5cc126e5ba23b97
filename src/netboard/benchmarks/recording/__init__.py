"""Robustness of recordings, and the cost of writing and reading them."""
