"""Integrators: one-step explicit, implicit and exponential methods, and the loop that applies them.

Parameters
----------
known : int
    Structure flags of the scene (`known_of`) [1].
k : int
    Number of a table [1].
"""
