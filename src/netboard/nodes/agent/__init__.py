"""The agent: one loop that owns one haptic device."""
