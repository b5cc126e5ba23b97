"""Recording files: write, read and locate them."""
