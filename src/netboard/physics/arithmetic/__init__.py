"""Arithmetic for kernels: strict sine and cosine, states as tuples, SIMD lanes."""
