"""Composition roots: one file = one process = one command. Nothing imports them but `cli`."""
