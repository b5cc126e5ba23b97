"""``netboard bench``: the group of the benchmarks.

A benchmark and its libraries are imported only when it runs.
"""

import typer

from netboard.services.bench import processes, simulations

app = typer.Typer(
    name="bench",
    help="Measure netboard on this machine: the physics, the loop from stylus to force, long runs, recording.",
    no_args_is_help=True,
)
for module in (simulations, processes):
    app.add_typer(module.app)
