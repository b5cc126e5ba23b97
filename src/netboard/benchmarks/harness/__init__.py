"""How a benchmark is run: its parts, their results with checked claims, and the machine."""
