"""Network links and wall clocks for fault tests; skipped where the machine does not permit them."""

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evidence.faults import links, wall_clock

pytestmark = pytest.mark.integration

PRINT_CLOCKS = "import time; print(time.time_ns() // 10**9, time.monotonic_ns() // 10**9)"
HOUR = 3600


@pytest.mark.skipif(bool(wall_clock.refusal()), reason=wall_clock.refusal())
def test_setting_the_wall_clock_of_a_process_keeps_its_monotonic_clock(tmp_path: Path) -> None:
    clock = wall_clock.WallClock(tmp_path)
    clock.set(HOUR)
    printed = subprocess.run(
        [sys.executable, "-c", PRINT_CLOCKS],
        env=os.environ | clock.environment,
        capture_output=True,
        text=True,
        check=True,
    )
    wall, monotonic = map(int, printed.stdout.split())
    assert abs(wall - HOUR - time.time()) < HOUR / 2
    assert abs(monotonic - time.monotonic()) < HOUR / 2


@pytest.mark.skipif(bool(links.refusal()), reason=links.refusal())
def test_disconnected_link_delays_messages_until_reconnected() -> None:
    before = Path("/proc/thread-self/ns/net").readlink()
    with links.Namespaces() as namespaces, socket.create_server((links.SERVER, 0)) as server:
        assert Path("/proc/thread-self/ns/net").readlink() != before
        server.settimeout(60)
        route = namespaces.route("left", server.getsockname()[1])
        command = [*route.prefix, sys.executable, "-c", _STATION.format(route.host, route.port)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, bufsize=0) as station:
            assert station.stdin is not None
            connection, (peer, _) = server.accept()
            with connection:
                connection.settimeout(60)
                assert peer == "10.213.1.2"
                assert connection.recv(5) == b"first"
                namespaces.pull("left")
                station.stdin.write(b"\n")
                connection.settimeout(0.2)
                with pytest.raises(TimeoutError):
                    connection.recv(6)
                namespaces.plug("left")
                connection.settimeout(60)
                assert connection.recv(6) == b"second"
    assert Path("/proc/thread-self/ns/net").readlink() == before


_STATION = """
import socket, sys
with socket.create_connection(("{}", {}), 60) as server:
    server.sendall(b"first")
    sys.stdin.readline()
    server.sendall(b"second")
    server.shutdown(socket.SHUT_WR)
    server.recv(1)
"""
