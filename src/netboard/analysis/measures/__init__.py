"""Measures of movements, forces and success: pure functions of arrays."""
