"""A scripted stand-in for Haply's Inverse Service: its WebSocket protocol 3.5, and devices that a hand holds.

On connection it sends the inventory, with configuration, state and status; then one state update for each message, as
documented. Tests unplug devices, and let it answer late, malformed, or not at all.
"""

import copy
import json
import threading
from typing import Any

import pytest

from waiting import until

server = pytest.importorskip("websockets.sync.server")
closed = pytest.importorskip("websockets.exceptions").ConnectionClosed

STIFFNESS = 150.0
"""Of the spring by which a hand holds a device [N/m]."""


def device(name: str, kind: str = "inverse3") -> dict[str, Any]:
    """Return a device as in the documented inventory, shortened."""
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {
        "device_id": name,
        "config": {
            "type": kind,
            "handedness": "right",
            "preset": "arm_front_centered",
            "basis": {"permutation": "XYZ"},
            "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
        },
        "state": {"cursor_position": dict(zero), "cursor_velocity": dict(zero), "current_cursor_force": dict(zero)},
        "status": {"calibrated": True, "in_use": False, "power_supply": True, "ready": True, "started": True},
    }


class FakeHaplyService:
    """The service, in a thread of this process."""

    def __init__(self) -> None:
        self.devices = {name: device(name) for name in ("049D", "04EA")}
        self.unplugged: set[str] = set()
        self.grips: list[dict[str, Any]] = []
        self.answer: str | None = None  # instead of the next state updates
        self.inventory: str | None = None  # instead of the documented one
        self.answering = threading.Event()  # while not set, nothing is answered
        self.answering.set()
        self.hang_up = threading.Event()
        self.updates = 0
        self.clients = 0
        self.placed: set[str] = set()
        self._server = server.serve(self._serve, "127.0.0.1", 0)
        self.url = f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self.answering.set()
        self._server.shutdown()
        self._thread.join()

    def force(self, name: str = "049D") -> tuple[float, float, float]:
        """Return the force that was commanded last, in the service's frame [N]."""
        found = self.devices[name]["state"]["current_cursor_force"]
        return found["x"], found["y"], found["z"]

    def place(self, x: float, y: float, z: float, name: str = "049D") -> None:
        """Fix the position of a cursor [m]."""
        self.placed.add(name)
        self.devices[name]["state"]["cursor_position"] = {"x": x, "y": y, "z": z}

    def wait(self, count: int = 3) -> None:
        """Wait until this many updates have been sent, or the client has gone."""
        target = self.updates + count
        until(lambda: self.updates >= target or not self.clients)

    def _listed(self, *parts: str) -> str:
        shown = [each for name, each in self.devices.items() if name not in self.unplugged]
        message = {
            "inverse3": [{key: each[key] for key in ("device_id", *parts)} for each in copy.deepcopy(shown)],
            "wireless_verse_grip": self.grips,
        }
        return json.dumps(message)

    def _serve(self, link: Any) -> None:
        self.clients += 1
        try:
            link.send(self.inventory or self._listed("config", "state", "status"))
            while not self.hang_up.is_set():
                self._take(json.loads(link.recv()))
                self.answering.wait()
                link.send(self.answer or self._listed("state", "status"))
                self.updates += 1
        except closed:
            return
        finally:
            self.clients -= 1

    def _take(self, message: dict[str, Any]) -> None:
        """Take the forces of a message; the hand yields to them."""
        for each in message["inverse3"]:
            values = each["commands"]["set_cursor_force"]["values"]
            state = self.devices[each["device_id"]]["state"]
            state["current_cursor_force"] = values
            if each["device_id"] not in self.placed:
                state["cursor_position"] = {axis: value / STIFFNESS for axis, value in values.items()}
