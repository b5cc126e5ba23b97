"""Integrity checks: all that can be verified about a recording."""
