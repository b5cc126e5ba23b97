"""The kernels that the processes of a session need, compiled before they start, in a process each.

A process compiles a kernel as it makes what calls it. So a server with its blocks and an agent at each side, also with
each robot partner of the blocks, run here once, on this machine alone, and stop at once. Displays, logger and console
have no kernels. A haptic device is not opened, but the kernels of its access are compiled if its backend can tell them.
"""

import hashlib
import logging
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, Future, wait
from contextlib import suppress
from dataclasses import replace
from tempfile import TemporaryDirectory

from netboard.base import kernel_cache
from netboard.base.compilation import Forecast
from netboard.base.config import SIDES, Config, Side, resolve
from netboard.base.device_kind import DeviceKind
from netboard.base.errors import NetboardError
from netboard.base.process.workers import terminate_workers, worker_processes
from netboard.base.tables.experiment import PERSON, STILL
from netboard.base.tables.rig import Agent
from netboard.base.terminal.compiling import CompilationBar
from netboard.devices.contract import registry
from netboard.devices.contract.access import CompiledAccess
from netboard.devices.simulated.partner import BACKEND
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.agent.agent import AgentNode
from netboard.nodes.agent.stylus_source import stylus_source_of
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.server import Server
from netboard.participants.seat.partners import POLICIES

EXPECTED = Forecast(230, (0.10, 0.21, 0.31, 0.40, 0.48, 0.55, 0.67, 0.77, 0.88, 1.0))
"""Kernels of a session with simulated devices and one kind of block, in two processes; each other device or model adds
some. The course is the mean of those on two cores and on one.
"""

INTERVAL_S = 0.2
"""Interval at which the kernels are counted [s]."""

OPENED = (DeviceKind.SIMULATED, DeviceKind.ROBOT)
"""Kinds of devices that are opened to compile their kernels, because nobody holds them."""


def compile_kernels(config: Config, blocks: Sequence[Config], here: Sequence[Side]) -> int:
    """Compile what a session of these blocks needs on this machine, with a bar; return how many kernels were compiled.

    ``here``: sides whose agent runs here.
    """
    done = kernel_cache.folder() / _name_of(config, blocks, here)
    noted = _are_built_in(config, blocks)
    if noted and done.exists():
        return 0
    before, pool = kernel_cache.count(), worker_processes(2)
    bar = CompilationBar(EXPECTED.with_cached(before))
    try:
        tasks = [pool.submit(_run_server, list(blocks)), pool.submit(_run_agents, config, list(blocks), tuple(here))]
        while not _are_over(tasks):
            if made := kernel_cache.count() - before:
                bar.compiled(made)
    finally:
        bar.rests()
        terminate_workers(pool)
    if noted:
        with suppress(OSError):  # a full disk, or a cache of another user: the next start looks again
            done.touch()
    return kernel_cache.count() - before


def _name_of(config: Config, blocks: Sequence[Config], here: Sequence[Side]) -> str:
    """Return the name of the file that says that a session's kernels are in the cache, for this CPU and compiler."""
    text = "\n".join((*kernel_cache.compiler(), *here, *map(resolve, (config, *blocks))))
    return f"session-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _are_built_in(config: Config, blocks: Sequence[Config]) -> bool:
    """Return whether all devices and robot partners are netboard's own: the code of others may change at any time."""
    agents = [config.agents.of(side) for side in SIDES]
    movers = {getattr(block.block, side) for block in blocks for side in SIDES} - {PERSON, STILL}
    movers |= {agent.options["partner"] for agent in agents if "partner" in agent.options}
    return {agent.device for agent in agents} <= registry.BACKENDS.keys() and movers <= POLICIES.keys()


def _are_over(tasks: Sequence[Future[None]]) -> bool:
    """Wait a little; return whether all tasks have ended, and raise what one has raised."""
    done, left = wait(tasks, INTERVAL_S)
    try:
        for task in done:
            task.result()
    except BrokenExecutor as error:
        raise NetboardError("a process that compiles ended, perhaps because memory ran out; start again") from error
    return not left


def _alone(config: Config, folder: str) -> Config:
    """Restrict a configuration to this machine, with ports and a folder that nothing else uses."""
    network = replace(config.network, host="127.0.0.1", bind="127.0.0.1", port=free_port())
    return replace(config, network=network, recording=replace(config.recording, directory=folder))


def _run_server(blocks: list[Config]) -> None:
    """Run a server with these blocks that is to stop at once."""
    logging.disable()  # nothing of this session concerns anybody
    with TemporaryDirectory() as folder, sockets.open_context() as context:
        sequence = BlockSequence([_alone(block, folder) for block in blocks])
        Server([(sequence, Attempts())], context, [None], autostart=False).run(lambda: True, {})


def _run_agents(config: Config, blocks: Sequence[Config], sides: Sequence[Side]) -> None:
    """Run the agents of these sides, each with its own device and as each robot partner; they are to stop at once."""
    logging.disable()
    for side in sides:
        access = _unopened(config, side)
        for served in _served(config, blocks, side):
            with TemporaryDirectory() as folder, sockets.open_context() as context:
                alone = _alone(served, folder)
                with registry.make(side, alone) as device:
                    node = AgentNode(alone, side, device, context, stylus_source_of(alone, device, context))
                    node.run(lambda: True)
                    if access is not None:
                        node.compile_for(access)
                        access = None


def _unopened(config: Config, side: Side) -> CompiledAccess | None:
    """Return how compiled code accesses the device of a side that a person holds; None if it has none."""
    if registry.kind_of(config.agents.of(side).device) in OPENED:
        return None
    try:
        return registry.make(side, config).compiled_unopened
    except NetboardError:  # such as a library that is missing: the agent says so, and this machine may lack the device
        return None


def _served(config: Config, blocks: Sequence[Config], side: Side) -> list[Config]:
    """Return the configurations of an agent with its own device, and with each robot partner of the blocks."""
    own = config.agents.of(side)
    found = {"": _with(config, side, own if registry.kind_of(own.device) in OPENED else Agent())}
    for block in blocks:
        mover = getattr(block.block, side)
        if mover not in (PERSON, STILL):
            seated = replace(block.agents.of(side), device=BACKEND, options={"partner": mover})
            found.setdefault(f"{mover} {block.partners.of(side)}", _with(block, side, seated))
    return list(found.values())


def _with(config: Config, side: Side, agent: Agent) -> Config:
    left, right = (agent if one == side else Agent() for one in SIDES)
    return replace(config, agents=replace(config.agents, left=left, right=right))
