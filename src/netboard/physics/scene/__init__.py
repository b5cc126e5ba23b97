"""The simulated scene: parameters, equations of motion, force conditions, energy, closed forms."""
