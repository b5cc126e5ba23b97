"""Integrity checks: everything that can be known to be right or wrong about a recording."""
