"""What recordings withstand, and what writing and reading them costs: studies of the real files and processes."""
