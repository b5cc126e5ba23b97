"""Recordings as files: write, read, locate."""
