"""What happens in one millisecond: the board, the ball and the couplings to the two hands (pure)."""
