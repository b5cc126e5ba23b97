"""Arithmetic for kernels: strict sine and cosine, states as tuples, SIMD lanes, random numbers.

Parameters
----------
lanes, one, other : lanes
    A vector register of floats, in any unit.
array : ndarray of float64
    C-contiguous.
offset : int
    Flat index of the first element in the array [1].
count : int
    Number of lanes; a compile-time constant [1].
stream : record of STREAM
    Where the random numbers are taken from; it is advanced.
i : int
    Index of a lane, or of an element; for lanes a compile-time constant [1].
"""
