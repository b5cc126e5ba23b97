"""How a benchmark is run: its processes, its parts, their results with checked claims, and the machine."""
