"""A recording played back: position, marks, commands, several side by side."""
