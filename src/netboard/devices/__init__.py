"""Haptic devices behind one interface, and the safety chain next to the motor."""
