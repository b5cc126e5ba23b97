"""Cost of a live tick, and the test problem of the studies of physics and stability."""
