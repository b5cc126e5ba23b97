"""Hands known by samples: extrapolation between them, and the drive it makes of that."""
