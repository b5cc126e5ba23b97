"""Hands known by samples: extrapolation between them, and the drive it makes of that.

Parameters
----------
k, c : float
    Stiffness and damping of the coupling [N/m, N s/m].
"""
