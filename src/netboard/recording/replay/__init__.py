"""Replay of recordings: position, marks, commands, and several recordings side by side."""
