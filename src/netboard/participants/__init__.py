"""Simulated people: an arm that holds the stylus and a brain that plays the task (pure)."""
