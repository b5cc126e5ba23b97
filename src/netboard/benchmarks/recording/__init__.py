"""Cost of writing and reading recordings."""
