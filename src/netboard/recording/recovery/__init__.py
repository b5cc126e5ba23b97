"""Crash recovery: the journal, spilled records, and the recovery of recordings."""
