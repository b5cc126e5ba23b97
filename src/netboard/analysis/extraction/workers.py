"""Executors of the extraction: processes of this machine, or workers of a Dask cluster.

An executor factory receives the recordings and checks that it can measure them before the first starts. A worker that
ends too early gives an error in one line.
"""

import gc
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
)
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from netboard.analysis.extraction.fingerprint import ROOT, fingerprint
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.process.workers import terminate_workers, worker_processes
from netboard.base.terminal.compiling import workers_compilation
from netboard.recording.export.formats import library

WorkerPool = Callable[[Sequence[Path]], AbstractContextManager[Executor]]
"""Function of the absolute paths of the recordings; returns a context manager that provides the executor."""

TIMEOUT = 10.0
"""Timeout for the scheduler to answer and to have workers [s]."""


def processes(workers: int) -> WorkerPool:
    """Measure in processes of this machine; in this process alone if one is enough."""

    @contextmanager
    def workers_of(recordings: Sequence[Path]) -> Iterator[Executor]:
        count = min(workers, len(recordings))
        pool = ThreadPoolExecutor(1) if count == 1 else worker_processes(count)
        try:
            with nullcontext() if count == 1 else workers_compilation():
                yield pool
        except BrokenExecutor as error:
            raise NetboardError(
                f"a worker process ended, perhaps because memory ran out; try fewer than --workers {count}"
            ) from error
        except BaseException:  # nobody takes their results any more
            if isinstance(pool, ProcessPoolExecutor):
                terminate_workers(pool)
            raise
        finally:
            pool.shutdown(cancel_futures=True)

    return workers_of


def warm(executor: Executor, count: int, *modules: str) -> None:
    """Let processes start and import modules while this one does something else."""
    if isinstance(executor, ProcessPoolExecutor):
        for _ in range(count):
            executor.submit(_import, modules)


def _import(modules: Sequence[str]) -> None:
    for name in modules:
        import_module(name)
    gc.freeze()  # the garbage collector would search all that the modules define, again and again


T = TypeVar("T")
R = TypeVar("R")


def begun(executor: Executor | None, function: Callable[[T], R], tasks: Sequence[T]) -> Iterator[tuple[T, R]]:
    """Begin all tasks, and return an iterator over those that are done with their results, in any order.

    Without an executor this process does each task when the iterator is asked for it.
    """
    if executor is None:
        return ((task, function(task)) for task in tasks)
    futures = {executor.submit(function, task): task for task in tasks}
    return ((futures[future], future.result()) for future in as_completed(futures))


def dask(address: str, patience: float = TIMEOUT, root: str = ROOT) -> WorkerPool:
    """Measure on the workers of a Dask cluster, whose code of `root` must be the same; timeout `patience` [s]."""
    distributed = library("distributed", "dask")

    @contextmanager
    def workers_of(recordings: Sequence[Path]) -> Iterator[Executor]:
        with _client(distributed, address, patience) as client:
            _check(client, address, recordings, root)
            executor = client.get_executor(pure=False)
            try:
                yield executor
            except (distributed.KilledWorker, CancelledError) as error:
                raise NetboardError(f"--dask {address}: lost a worker or the scheduler: {error}") from error
            finally:
                executor.shutdown(wait=False)

    return workers_of


@contextmanager
def _client(distributed: Any, address: str, patience: float) -> Iterator[Any]:
    """Connect to a scheduler with workers."""
    try:
        library("distributed.comm.addressing", "dask").get_address_host_port(address, strict=False)
    except ValueError as error:  # a client of it would wait for 20 s at its end, and then print a traceback
        raise ConfigError(f"--dask {address}: {error}; expected an address such as tcp://10.0.0.5:8786") from None
    try:
        client = distributed.Client(address, timeout=patience, set_as_default=False)
    except OSError as error:
        raise ConfigError(f"--dask {address}: no scheduler answers there within {patience:g} s ({error})") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=patience)
        except TimeoutError as error:
            raise ConfigError(f"--dask {address}: its scheduler has had no workers for {patience:g} s") from error
        yield client


def _check(client: Any, address: str, recordings: Sequence[Path], root: str) -> None:
    """Find workers with another version of the code, or without access to the files."""
    for worker, account in client.run(_account, list(recordings), root, on_error="return").items():
        who = f"--dask {address}: its worker {worker}"
        if isinstance(account, Exception):
            raise ConfigError(f"{who} has no netboard of this version ({account}); install the same version there")
        installed, code, unseen = account
        if code != fingerprint(root):
            raise ConfigError(
                f"{who} has netboard {installed} with other code or other numpy, scipy or numba than here "
                f"({version('netboard')}); install the same version there"
            )
        if unseen:
            raise ConfigError(f"{who} cannot read {unseen[0]}; all machines must see the recordings at the same path")


def _account(recordings: Sequence[Path], root: str) -> tuple[str, str, list[Path]]:
    """Return, on a worker, its netboard version and code digest, and the recordings that it cannot access."""
    return version("netboard"), fingerprint(root), [path for path in recordings if not path.is_file()]
