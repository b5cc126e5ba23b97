"""Worker processes of a benchmark: each waits for an order, carries it out, answers, and waits again.

Orders and answers are lines of JSON over pipes, so an idle worker disturbs nothing. It ends when its pipe is closed,
so with the process that started it.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

from netboard.base.errors import NetboardError
from netboard.base.system.supervision import supervision

END_SECONDS = 5.0
"""Time after which a worker that does not end is killed [s]."""


class Worker:
    """Handle of a worker process, which finds the modules that this one does."""

    def __init__(self, module: str, *arguments: str, log: Path) -> None:
        self._name = f"{module.rpartition('.')[2]} {' '.join(arguments[:-1])}".strip()
        self._log = log
        with log.open("ab") as file:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=file,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
                text=True,
                **supervision.new_group(),
            )

    @property
    def process_id(self) -> int:
        """Its process id [1]."""
        return self._process.pid

    def order(self, **order: Any) -> None:
        """Send an order; take its answer before the next order."""
        try:
            _pipe(self._process.stdin).write(json.dumps(order) + "\n")
            _pipe(self._process.stdin).flush()
        except OSError as error:
            raise self._gone() from error

    def answer(self) -> dict[str, Any]:
        """Wait until the worker has carried out its order, and return the result."""
        line = _pipe(self._process.stdout).readline()
        if not line:
            raise self._gone()
        found: dict[str, Any] = json.loads(line)
        return found

    def stop(self) -> None:
        """End the worker."""
        process = self._process
        try:
            process.communicate(timeout=END_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()

    def _gone(self) -> NetboardError:
        lines = self._log.read_text(errors="replace").strip().splitlines()
        return NetboardError(f"the {self._name} ended: {lines[-1] if lines else 'without output'}")


class Workers(ExitStack):
    """Some workers; leaving the context ends them."""

    def start(self, name: str, module: str, *arguments: str, folder: Path) -> Worker:
        """Start another worker."""
        worker = Worker(module, *arguments, log=folder / f"{name.replace(' ', '-')}.log")
        self.callback(worker.stop)
        return worker


def serve(carry_out: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Run a worker: carry out orders until there are no more.

    - `carry_out`: takes an order and returns its result, both plain data.
    """
    for line in sys.stdin:
        sys.stdout.write(json.dumps(carry_out(json.loads(line))) + "\n")
        sys.stdout.flush()


def _pipe(stream: IO[str] | None) -> IO[str]:
    """Return a stream that was requested as a pipe."""
    if stream is None:
        raise ValueError("the worker was started without pipes")
    return stream
