"""What happens in a session: the trial machine, what becomes of attempts, and where a session stands (pure)."""
