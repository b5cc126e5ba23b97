"""The trial state machine, the quality rules for attempts, and repeated trials."""
