"""Composition roots: one file = one process = one command. Only `cli` imports them."""
