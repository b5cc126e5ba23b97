"""Largest stable step and delay of a scene, and the method chosen from them."""
