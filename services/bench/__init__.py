"""Commands of ``netboard bench``: benchmarks of real processes, and of simulations. Only `group` imports them."""
