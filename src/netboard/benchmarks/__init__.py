"""Benchmarks that a lab runs on its own machine: ``netboard bench``. Nothing of the product imports this wing.

Open `harness` first: it runs the parts in turn, shows their tables and checked claims, and describes the machine. Each
room measures one concern: `physics`, `environments`, `stability`, `loop`, `recording`. What shows that netboard itself
is right is in `tests/evidence`: faults, attacks, comparison with other libraries, validation of the analysis and of the
participants.
"""
