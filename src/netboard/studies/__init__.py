"""What labs and papers run offline: work and precision of the methods, stability, and what machine it was."""
