"""Device setup: list, calibrate, identify and check the devices of a rig."""
