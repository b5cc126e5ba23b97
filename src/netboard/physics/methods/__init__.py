"""Integrators: one-step explicit, implicit and exponential methods, and the loop that applies them."""
