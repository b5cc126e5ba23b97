"""Writing, reading, recovering and verifying recordings (MCAP)."""
