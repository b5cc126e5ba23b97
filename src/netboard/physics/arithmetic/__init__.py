"""Arithmetic for kernels: strict sine and cosine, states as tuples, SIMD lanes.

Parameters
----------
lanes, one, other : lanes
    A vector register of floats, in any unit.
array : ndarray of float64
    C-contiguous.
"""
