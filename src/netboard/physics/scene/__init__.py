"""What is simulated: parameters, equations of motion, force conditions, energy, closed forms."""
