"""Options that all benchmarks have, and the decorator that makes a benchmark a command."""

from collections.abc import Callable
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import typer

from netboard.services.options import examples


def _common(
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; default: a new one here."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Short version, most in less than a minute.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Write into an existing folder.")] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the results there, as JSON.")
    ] = None,
) -> None:
    """Declare the options that all benchmarks have."""


def benchmark(app: typer.Typer, *lines: str) -> Callable[[Callable[..., int | None]], Callable[..., None]]:
    """Return the decorator that makes a function a command of a group, with these examples.

    The function gets the options of all benchmarks (`netboard.benchmarks.harness.running.Options`) as its first
    argument, and its own as the others. It returns the exit code; None is 0.
    """

    def register(function: Callable[..., int | None]) -> Callable[..., None]:
        common, benchmark_options = signature(_common), signature(function)
        names = list(common.parameters)

        @wraps(function)
        def command(**values: Any) -> None:
            from netboard.base.process.stopping import interrupted_by_stop_signals
            from netboard.benchmarks.harness.running import Options

            options = Options(**{name: values.pop(name) for name in names})
            with interrupted_by_stop_signals():  # a benchmark ends the processes that it has started
                code = function(options, **values)
            raise typer.Exit(code or 0)

        parameters = [*common.parameters.values(), *list(benchmark_options.parameters.values())[1:]]
        vars(command)["__signature__"] = benchmark_options.replace(parameters=parameters)
        command.__annotations__ = {one.name: one.annotation for one in parameters}
        return app.command(epilog=examples(*lines))(command)

    return register
