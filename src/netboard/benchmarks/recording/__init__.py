"""What recordings withstand, and what writing and reading them costs."""
