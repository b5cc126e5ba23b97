"""The agent: one loop that owns one device."""
