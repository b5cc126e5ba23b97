"""How a benchmark is run: parts, results with verdicts, the machine."""
