"""``netboard devices``: the devices of a rig, one at a time and without a server.

A command that moves a device says so first, and waits for a typed sentence or ``--yes``.
"""

import typer

from netboard.services.devices import calibrate, examine, identify, list_, monitor

app = typer.Typer(
    name="devices",
    help="List, test, identify, watch and calibrate haptic devices, without a server.",
    no_args_is_help=True,
)
for command in (list_, examine, identify, monitor, calibrate):
    app.add_typer(command.app)
