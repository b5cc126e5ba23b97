"""What survives a crash: the journal, spilled records, and recordings made whole again."""
