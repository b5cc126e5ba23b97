"""Commands of ``netboard bench``: a module for each room of the benchmarks. Only `group` imports them."""
