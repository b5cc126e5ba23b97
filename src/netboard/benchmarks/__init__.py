"""Benchmarks and stability studies: ``netboard bench``. Nothing of the product imports this wing.

Open `harness` first: parts that are run in turn, tables with verdicts, the machine they ran on. Each room measures
one concern: `physics`, `stability`, `loop`, `coupling`, `faults`, `recording`, `analysis`.
"""
