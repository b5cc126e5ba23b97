"""The plan of one dyad: conditions, counterbalancing, blocks."""
