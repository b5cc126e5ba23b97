"""The operator's endpoint of the control channel, and the launcher of local processes."""
