"""What the processes say to each other: messages, their bytes, and the rules of a session (pure)."""
