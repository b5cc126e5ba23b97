"""Blocks and sessions with simulated participants, through the live stage, as fast as the machine allows."""
