"""The device interface, the registry of backends, USB identification, profiles, and velocity from encoder positions."""
