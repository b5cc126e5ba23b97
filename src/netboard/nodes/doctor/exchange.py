"""Exchange between a server and two agents over loopback: processes, sockets and real-time settings of a session.

Each millisecond both agents send a frame as large as a sample, and the server answers with one as large as a force. The
frames carry time stamps. Nothing is computed between them, so the exchange is the lower bound of a loop.
"""

import json
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import Pacer, now_ns
from netboard.base.config import SIDES
from netboard.base.errors import NetboardError
from netboard.base.process.realtime import PLACES, Priority, cpus_for, io_priority, prepare, steady_loop
from netboard.base.tables.rig import Network, Realtime
from netboard.base.tick import TICK_SECONDS
from netboard.network.protocol.fixed import FORCE, STYLUS
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.doctor.network import LOOPBACK
from netboard.nodes.doctor.timing import PROGRESS_INTERVAL_S, WARM_UP_TICKS

ANSWER = struct.Struct(f"<qq{FORCE.size - 16}x")
"""Answer of the server: when it received the frame, and when it sends this one [ns]."""

LEAD_NS = 50_000_000
"""Time between the start signal and the first exchange [ns]."""

TIMEOUT_MS = 5_000
"""Time without a frame after which a process gives up [ms]."""


@dataclass(frozen=True)
class ExchangeTimes:
    """Times of all exchanges; rows are the sides [ns]."""

    woke_ns: NDArray[np.int64]  # start of an agent's millisecond after its deadline
    up_ns: NDArray[np.int64]  # from the start of the millisecond to the server's receipt
    down_ns: NDArray[np.int64]  # from the server's sending to the agent's receipt
    server_us: float  # CPU time of the server for an exchange, with ZeroMQ's thread [us]


def measure(wanted: Realtime, seconds: float, progress: Callable[[float], None]) -> ExchangeTimes:
    """Exchange frames for a while, each process with the settings of its loop."""
    port, ticks = free_port(), round(seconds / TICK_SECONDS) + WARM_UP_TICKS
    request = {"wanted": asdict(wanted), "port": port, "ticks": ticks}
    with _started([{**request, "place": place} for place in PLACES]) as processes:
        start_ns = now_ns() + LEAD_NS
        for process in processes:
            _stdin(process).write(f"{start_ns}\n")
            _stdin(process).flush()
        until = time.monotonic() + ticks * TICK_SECONDS
        while (left := until - time.monotonic()) > 0:
            progress(min(1.0, max(0.0, 1 - left / (ticks * TICK_SECONDS))))
            time.sleep(min(left, PROGRESS_INTERVAL_S))
        server, *agents = (json.loads(_line(process)) for process in processes)
    stamps = np.stack([np.array(agent["stamps"], np.int64)[WARM_UP_TICKS:] for agent in agents])
    return ExchangeTimes(stamps[:, :, 0], stamps[:, :, 1], stamps[:, :, 2], server["cpu_us"])


@contextmanager
def _started(requests: list[dict[str, Any]]) -> Iterator[list[subprocess.Popen[str]]]:
    """Start processes and wait until each is ready; end them on leaving."""
    processes = [
        subprocess.Popen(
            [sys.executable, "-m", "netboard.nodes.doctor.exchange", json.dumps(request)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for request in requests
    ]
    try:
        for process in processes:
            _line(process)
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def _stdin(process: subprocess.Popen[str]) -> IO[str]:
    assert process.stdin is not None
    return process.stdin


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    if line := process.stdout.readline():
        return line
    trouble = process.communicate()[1].strip().splitlines()
    raise NetboardError(f"the exchange over loopback failed: {(trouble or ['no message'])[-1]}")


def main(place: str, wanted: Realtime, port: int, ticks: int) -> None:
    """Be the server or an agent of the exchange, in this process."""
    priority = Priority.SERVER if place == PLACES[0] else Priority.AGENT
    granted = prepare(wanted, priority, cpus_for(place, wanted))
    where = channels.addresses(Network(host=LOOPBACK, bind=LOOPBACK, port=port))
    with sockets.open_context(io_priority(granted, priority)) as context:
        if place == PLACES[0]:
            socket = sockets.motion_server(context, where.listen(channels.MOTION)).socket
        else:
            socket = sockets.motion_agent(context, where.reach(channels.MOTION), f"agent.{place}")
        socket.rcvtimeo = socket.sndtimeo = TIMEOUT_MS
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        start_ns = int(sys.stdin.readline())
        steady_loop()
        result = serve(socket, ticks * len(SIDES)) if place == PLACES[0] else ask(socket, ticks, start_ns)
        sys.stdout.write(json.dumps(result) + "\n")
        sys.stdout.flush()
        sys.stdin.readline()  # the parent ends this process when it has all results


def serve(socket: sockets.Socket, count: int) -> dict[str, Any]:
    """Answer frames; return the CPU time for each [us]."""
    before = time.process_time()
    for _ in range(count):
        sender, _ = socket.recv_multipart()
        received_ns = now_ns()
        socket.send_multipart((sender, ANSWER.pack(received_ns, now_ns())))
    return {"cpu_us": (time.process_time() - before) / count * 1e6}


def ask(socket: sockets.Socket, ticks: int, start_ns: int) -> dict[str, Any]:
    """Send a frame each millisecond and wait for the answer; return the stamps of each exchange."""
    frame, stamps, pacer = bytes(STYLUS.size), [], Pacer(start_ns)
    for _ in range(ticks):
        late_ns = pacer.wait()
        woke_ns = now_ns()
        socket.send(frame)
        received_ns, sent_ns = ANSWER.unpack(socket.recv())
        stamps.append((late_ns, received_ns - woke_ns, now_ns() - sent_ns))
    return {"stamps": stamps}


if __name__ == "__main__":
    request = json.loads(sys.argv[1])
    main(request["place"], Realtime(**request["wanted"]), request["port"], request["ticks"])
