"""A recording as something that is played: where it is, what happened when, and what can be asked of it."""
