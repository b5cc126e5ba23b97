"""Recordings in the formats of other tools: tidy tables of them, what their columns mean, and the files."""
