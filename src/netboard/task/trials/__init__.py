"""The trial state machine, the quality of an attempt, and attempts that are repeated."""
