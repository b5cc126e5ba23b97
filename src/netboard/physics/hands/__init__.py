"""Hands known by samples: extrapolation between them, and the drive it makes of that.

Parameters
----------
k, c : float
    Stiffness and damping of the coupling [N/m, N s/m].
z, vz, az : float
    Height, velocity and acceleration of the stylus, as sampled or at the start of a step [m, m/s, m/s2].
held : Held
    Motion of the hands between their samples.
ticks : ndarray of int64, shape (n,)
    Times, in the ticks of `Held` [1/scale s].
"""
