"""``netboard bench physics``: what the physics costs, and how good it is."""
