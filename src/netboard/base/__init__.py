"""Foundations of all other wings.

Errors, the configuration's tables, compiled kernels, the clock, what a process owes its machine, and what POSIX and
Windows do in different ways (`system`).

Open `config` first: one TOML text becomes frozen dataclasses (`tables`), read and written by `settings`. `tick`
declares the columns of a tick, `compiled` how numba kernels are compiled and cached. The pure wings (`physics`, `task`,
`stage`, `participants`) import these and `errors`, and `terminal` for tables; the rest uses the machine: `clock`,
`process`, `files` and `terminal`. This wing contains no physics, trials or network.

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
path : tuple of str
    Name of a table in TOML, one item per dot; empty for the whole.
physics : Physics
    The table ``[physics]``.
declared : sequence of str
    Words that a key may have; the number of a word is its place.
"""
