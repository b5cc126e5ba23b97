"""The logger, and subscribers to the log such as LSL outlets."""
