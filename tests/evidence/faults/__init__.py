"""Faults, attacks and malformed messages against real processes."""
