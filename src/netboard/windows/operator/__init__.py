"""The operator's console: status lamps, commands, attempts, notes."""
