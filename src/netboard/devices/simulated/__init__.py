"""Devices without hardware: the virtual device, and playback of a recorded stylus."""
