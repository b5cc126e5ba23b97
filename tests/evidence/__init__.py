"""Evidence for netboard: studies, faults and attacks that show what the documentation claims. It is not installed.

``make evidence`` lists the items, ``make evidence ARGS="faults --quick"`` runs one. Each writes tables with checked
claims, as ``netboard bench`` does and by its harness (`netboard.benchmarks.harness`); `docs/data` has copies, from
which the pages show tables. Each room is one concern: `physics`, `stability`, `loop`, `coupling`, `faults`,
`recording`, `participants`, `analysis`. Nothing in netboard imports this package.
"""
