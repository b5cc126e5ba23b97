"""Blocks and sessions with simulated people, through the live stage and as fast as the machine allows."""
