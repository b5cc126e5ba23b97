"""The virtual coupling over a delay, and the force conditions."""
