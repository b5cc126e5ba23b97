"""How a scene is stepped through time: one-step methods, exponential ones, those for offline runs, and who chooses."""
