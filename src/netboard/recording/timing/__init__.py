"""Timing of a live session, tick by tick: what the recorded stamps say of each stutter, and of its cause."""
