"""The operator's end of the control channel, and the launcher of local processes."""
