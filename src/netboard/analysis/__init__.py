"""What recordings mean: measures of movements, forces and success as pure functions of arrays."""
