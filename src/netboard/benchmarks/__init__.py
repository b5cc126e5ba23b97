"""Benchmarks and stability studies: ``netboard bench``. Nothing of the product imports this wing.

Open `harness` first: it runs the parts in turn, shows their tables and checked claims, and describes the machine. Each
room measures one concern: `physics`, `stability`, `loop`, `coupling`, `faults`, `recording`, `participants`,
`analysis`.
"""
