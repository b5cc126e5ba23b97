"""The operator's endpoint of the control channel, the launcher of local processes, and work on one device."""
