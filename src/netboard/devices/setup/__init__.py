"""Tools for the devices of a rig: list, calibrate, identify, check."""
