"""Keys of a rig: who may connect, as whom."""
