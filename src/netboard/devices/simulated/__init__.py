"""Devices without hardware: the virtual device, playback of a recorded stylus, imperfections."""
