"""A simulated haptic device: its mechanics, its encoders' velocity, and the forces that it renders by itself. Pure."""
