"""The operator's window: what is going on, what is wrong, and what to do about it."""
