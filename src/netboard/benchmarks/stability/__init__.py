"""Stability limits of the integration methods."""
