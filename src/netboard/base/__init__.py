"""Foundations of all other wings.

Errors, the configuration's tables, compiled kernels, the clock, and what a process owes its machine.

Open `config` first: one TOML text becomes frozen dataclasses (`tables`), read and written by `settings`. `tick`
declares the columns of a tick, `compiled` how numba kernels are compiled and cached. `clock`, `process`, `workers`,
`terminal`, `new_file` and `figure_file` are the only modules here that touch the machine; the pure wings (`physics`,
`task`, `stage`, `participants`) may import all others. This wing contains no physics, trials or network.

Parameters
----------
config : Config
    The whole configuration.
cls : type
    The dataclass of a table, or of the whole configuration.
text : str
    The TOML text; missing tables and keys take their defaults.
source : str
    Name of the file, for error messages.
"""
