"""The logger, and other subscribers to the log: LSL outlets."""
