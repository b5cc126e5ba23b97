"""Recovery of damaged recordings."""
