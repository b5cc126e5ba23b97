"""Backend ``haply``: an Inverse3 through Haply's own service, which speaks JSON over a WebSocket on this machine.

On connection the service sends an inventory of all devices, with their configuration. After that it answers each
message with one update of the state of all devices, so the rate is that of the messages. A thread sends the newest
force and takes the answer, at 1 kHz at most; the device returns the newest state. The service's frame is x right, y
forward, z up; the scene's is x towards the person, y right, z up.

A force that the agent has not renewed is sent as zero, and stays so until a zero force is set. A device is ready while
the service calls it ready, calibrated and powered, no force has been cut, and the cursor is inside the workspace.

Options (``agents.<side>.options``): see `HaplyOptions`. How to set it up: docs/how-to/haply.md.
"""

import contextlib
import json
import logging
import reprlib
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from time import sleep
from typing import Annotated, Any, NamedTuple, final

from netboard.base.config import Config, Side
from netboard.base.errors import DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about, parse_json
from netboard.base.system.monotonic import monotonic_ns
from netboard.base.system.scheduling import scheduling
from netboard.devices.contract.device import Box, Device, DeviceInfo, Found, Reading
from netboard.devices.contract.selection import only
from netboard.participants.body.device_forces import within

log = logging.getLogger(__name__)

URL = "ws://localhost:10001"
"""Default address of the service (docs.haply.co, WebSocket Protocol 3.5)."""

KINDS = ("inverse3", "inverse3x", "minverse")
"""Types of devices in the list ``inverse3``, by ``config.type``."""

RADIUS = {"minverse": 0.04}
DEFAULT_RADIUS = 0.10
"""Radius of the workspace about the centre of a centred preset: that of the vendor's tutorial 06 [m]."""

CENTRED = ("arm_front_centered", "led_front_centered")
"""Presets whose origin is the centre of the workspace."""

BASIS = "XYZ"
"""Permutation of the axes that leaves the service's own frame."""

MAX_FORCE = 2.0
"""Largest force. No data sheet could be had; NVIDIA's Isaac Lab limits the device to this for safety [N]."""

CONTINUOUS_SHARE = 0.25
"""Ratio of continuous to peak force; no source states one, so it is that of the Falcon's backend [1]."""

PERIOD_S = 1e-3
"""Shortest period of the messages [s]."""

CONNECT_S = 2.0
"""Timeout of the connection and of the inventory [s]."""

STALL_NS = 50_000_000
"""Timeout after which a service without answers counts as stalled [ns]."""

ANSWER_S = 1.0
"""Timeout of one answer in the thread, and of the zero force before the connection is closed [s]."""

BUTTONS = ("a", "b", "c")
"""Buttons of a Wireless VerseGrip, bit 0 first."""

FARTHEST = 1e6
"""A position or velocity of this magnitude is none [m, m/s]."""

NO_FORCE = (0.0, 0.0, 0.0)

Message = dict[str, Any]


@dataclass(frozen=True, slots=True)
class HaplyOptions:
    """Options of a Haply device."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    serial: Annotated[str, about("device id in Haply's service, such as 049D; empty: the only one")] = ""
    grip: Annotated[str, about("device id of the Wireless VerseGrip whose buttons count; empty: no buttons")] = ""
    url: Annotated[str, about("address of Haply's service")] = URL
    force_timeout_ms: Annotated[float, about("age at which a force is sent as zero", "ms", ge=2, le=200)] = 20.0
    resolution: Annotated[float, about("smallest change of position; 0 if unknown", "m", ge=0, le=0.01)] = 0.0


class HaplyState(NamedTuple):
    """State of a device from one answer of the service."""

    stamp_ns: int  # when the answer arrived [ns]
    position: tuple[float, float, float]  # in the service's frame [m]
    velocity: tuple[float, float, float]  # [m/s]
    buttons: int
    usable: bool  # ready, calibrated and powered, and no force has been cut


class MalformedMessage(ValueError):
    """A message that is not as documented."""


def parsed(text: str | bytes) -> Message:
    """Return a message of the service; raise `MalformedMessage` if it is not an object in JSON."""
    try:
        message = parse_json(text)
    except ValueError as error:
        raise MalformedMessage(f"no JSON ({error})") from error
    if not isinstance(message, dict):
        raise MalformedMessage(f"expected an object, found {type(message).__name__}")
    return message


def devices_in(message: Message, kind: str) -> dict[str, Message]:
    """Return the devices of a kind in a message, by their id."""
    listed = message.get(kind, [])
    if not isinstance(listed, list) or not all(isinstance(each, dict) and "device_id" in each for each in listed):
        raise MalformedMessage(f"{kind}: expected a list of objects with a device_id")
    return {str(each["device_id"]): each for each in listed}


def state_of(message: Message, device: str, grip: str, stamp_ns: int) -> HaplyState | None:
    """Return the state of a device in a message; None if the device is not there.

    Raises `MalformedMessage` if a value that is needed is missing or no number.
    """
    entry = devices_in(message, "inverse3").get(device)
    if entry is None:
        return None
    state, status = (_object(entry, key) for key in ("state", "status"))
    position, velocity = (_vector(state, key) for key in ("cursor_position", "cursor_velocity"))
    usable = all(status.get(key) is True for key in ("ready", "calibrated", "power_supply"))
    return HaplyState(stamp_ns, position, velocity, _buttons(message, grip), usable)


def _object(entry: Message, key: str) -> Message:
    value = entry.get(key)
    if not isinstance(value, dict):
        raise MalformedMessage(f"{key}: expected an object, found {value!r}")
    return value


def _vector(state: Message, key: str) -> tuple[float, float, float]:
    """Return a vector of a state."""
    found = _object(state, key)
    x, y, z = (found.get(axis) for axis in "xyz")
    for value in (x, y, z):
        if not isinstance(value, int | float) or not abs(value) < FARTHEST:
            raise MalformedMessage(f"{key}: expected three numbers below {FARTHEST:g}, found {reprlib.repr(found)}")
    return float(x), float(y), float(z)  # type: ignore[arg-type]  # checked above


def _buttons(message: Message, grip: str) -> int:
    """Return the mask of the pressed buttons of a grip; 0 for none."""
    entry = devices_in(message, "wireless_verse_grip").get(grip) if grip else None
    if entry is None:
        return 0
    pressed = _object(_object(entry, "state"), "buttons")
    return sum(1 << bit for bit, name in enumerate(BUTTONS) if pressed.get(name) is True)


def force_command(device: str, force: tuple[float, float, float]) -> str:
    """Return the message that sets a force in the service's frame [N]."""
    values = dict(zip("xyz", force, strict=True))
    return json.dumps(
        {"inverse3": [{"device_id": device, "commands": {"set_cursor_force": {"values": values}}}]},
        separators=(",", ":"),
    )


class HaplyConnection:
    """A connection to the service, and the inventory that it has sent.

    Raises `DeviceNotFound` if nothing answers at ``url``, or something else than the service.
    """

    def __init__(self, url: str) -> None:
        try:
            from websockets.exceptions import WebSocketException  # noqa: PLC0415
            from websockets.sync.client import connect  # noqa: PLC0415
        except ImportError as error:
            raise DeviceNotFound(f"websockets is not installed ({error}): pip install 'netboard[devices]'") from error
        self.failures = (OSError, WebSocketException)  # of `send` and `receive`; silence is a TimeoutError
        self._stack = contextlib.ExitStack()  # the library connects in a context only
        try:
            self._link = self._stack.enter_context(
                connect(url, open_timeout=CONNECT_S, close_timeout=ANSWER_S, compression=None, proxy=None)
            )
        except (*self.failures, ValueError) as error:
            raise DeviceNotFound(
                f"Haply's service does not answer at {url} ({error}): install and start it, docs/how-to/haply.md"
            ) from error
        try:
            self.inventory = self.receive(CONNECT_S)
            self.listed = devices_in(self.inventory, "inverse3")
        except (*self.failures, MalformedMessage) as error:
            self.close()
            why = str(error) or f"nothing within {CONNECT_S:g} s"
            raise DeviceNotFound(f"what answers at {url} sent no inventory as documented: {why}") from error

    def send(self, text: str) -> None:
        """Send a message."""
        self._link.send(text)

    def receive(self, timeout: float) -> Message:
        """Return the next message; raise `TimeoutError` if there is none in time [s]."""
        return parsed(self._link.recv(timeout=timeout))

    def close(self) -> None:
        """Close the connection."""
        with contextlib.suppress(*self.failures):
            self._stack.close()


class HaplyLink:
    """A thread that exchanges forces for states with the service."""

    def __init__(self, link: HaplyConnection, device: str, grip: str, timeout_ns: int) -> None:
        self._link, self._device, self._grip, self._timeout_ns = link, device, grip, timeout_ns
        self._force = (NO_FORCE, 0)
        self._cut = False
        self._closing = threading.Event()
        self._zeroed = threading.Event()
        self.state: HaplyState | None = None  # newest
        self.fault: DeviceError | None = None  # why the thread has ended
        self._follow = scheduling.as_here()  # a new thread is not as real-time by itself, and a busy machine delays it
        self._thread = threading.Thread(target=self._run, name="haply", daemon=True)
        self._thread.start()

    def put(self, force: tuple[float, float, float]) -> None:
        """Set the force from the next message on, in the service's frame [N]."""
        self._force = (force, monotonic_ns())

    def close(self) -> bool:
        """Send zero force and end the thread; return whether the service has answered the zero force."""
        self._closing.set()
        self._thread.join(2 * ANSWER_S)
        self._link.close()
        return self._zeroed.is_set()

    def _run(self) -> None:
        """Exchange messages until the link is closed, or fails."""
        self._follow()
        try:
            while not self._closing.is_set():
                began_ns = monotonic_ns()
                self._exchange(self._chosen(began_ns))
                sleep(max(PERIOD_S - 1e-9 * (monotonic_ns() - began_ns), 0.0))
            self._exchange(NO_FORCE)
            self._zeroed.set()
        except TimeoutError:
            self.fault = DeviceTimeout(f"Haply's service has not answered for {ANSWER_S:g} s")
        except MalformedMessage as error:
            self.fault = DeviceLost(f"Haply's service sent a message that is not as documented: {error}")
        except DeviceError as error:
            self.fault = error
        except self._link.failures as error:
            self.fault = DeviceLost(f"the connection to Haply's service has ended ({error})")
        except Exception as error:  # nobody waits for this thread: what is not foreseen must not end it in silence
            log.exception("the exchange with Haply's service has failed")
            self.fault = DeviceLost(f"the exchange with Haply's service has failed ({error!r})")
        finally:
            if not self._zeroed.is_set():  # whatever the fault, the service must not keep a force
                with contextlib.suppress(*self._link.failures):
                    self._link.send(force_command(self._device, NO_FORCE))

    def _chosen(self, now_ns: int) -> tuple[float, float, float]:
        """Return the force to send: the newest, or zero from a timeout until a zero force is set."""
        force, stamp_ns = self._force
        if not any(force):
            self._cut = False
        elif now_ns - stamp_ns > self._timeout_ns:
            self._cut = True
        return NO_FORCE if self._cut else force

    def _exchange(self, force: tuple[float, float, float]) -> None:
        """Send a force and take the answer."""
        self._link.send(force_command(self._device, force))
        message = self._link.receive(ANSWER_S)
        state = state_of(message, self._device, self._grip, monotonic_ns())
        if state is None:
            raise DeviceLost(f"Haply's service no longer lists the device {self._device}: was it unplugged?")
        self.state = state._replace(usable=state.usable and not self._cut)


@final
class Haply(Device):
    """A Haply device."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(HaplyOptions)
        self._link: HaplyLink | None = None
        self._radius = DEFAULT_RADIUS

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """List the devices that the service shows."""
        agents = (config.agents.left, config.agents.right)
        urls = [str(agent.options.get("url", URL)) for agent in agents if agent.device == "haply"]
        link = HaplyConnection(urls[0] if urls else URL)
        link.close()
        return tuple(Found(_model_of(entry), name) for name, entry in link.listed.items())

    def _open(self) -> DeviceInfo:
        link = HaplyConnection(self._options.url)
        try:
            name, entry = self._find(link.listed)
            info = self._info_of(name, entry)
            _require_usable(name, entry)
            timeout_ns = round(self._options.force_timeout_ms * 1e6)
            self._link = HaplyLink(link, name, self._options.grip, timeout_ns)
            self._first_state(self._link)
        except BaseException:
            if self._link is None:
                link.close()
            else:
                self._close()
            raise
        return info

    def _find(self, listed: Mapping[str, Message]) -> tuple[str, Message]:
        """Select a device."""
        if not listed:
            raise DeviceNotFound("Haply's service lists no Inverse3: is it plugged in and switched on?")
        wanted = self._options.serial
        fitting = [one for one in listed.items() if wanted in ("", one[0])]
        return only(
            fitting, list(listed.items()), "Haply", {"serial": wanted}, lambda one: f"{_model_of(one[1])} {one[0]}"
        )

    def _info_of(self, name: str, entry: Message) -> DeviceInfo:
        """Return the properties of a device; refuse one whose frame is not known."""
        config = _object_or_error(entry, "config")
        preset, basis = config.get("preset"), config.get("basis", {})
        if preset not in CENTRED:
            raise DeviceError(
                f"the Haply device {name} has the preset {preset!r}, expected one of {', '.join(CENTRED)}, so that the "
                "middle of its workspace is known: choose it in Haply Hub (service 3.5 or later)"
            )
        if not isinstance(basis, dict) or basis.get("permutation") != BASIS:
            raise DeviceError(f"the Haply device {name} has the basis {basis!r}, expected the permutation {BASIS}")
        kind = str(config.get("type", KINDS[0]))
        self._radius = r = RADIUS.get(kind, DEFAULT_RADIUS)
        recorded = ("preset", "handedness", "gravity_compensation", "torque_scaling", "home_return", "filters")
        return DeviceInfo(
            model=_model_of(entry),
            serial=name,
            max_force=MAX_FORCE,
            continuous_force=CONTINUOUS_SHARE * MAX_FORCE,
            resolution=self._options.resolution,
            workspace=Box(-r, -r, -r, r, r, r),
            details={key: json.dumps(config[key]) for key in recorded if key in config},
        )

    def _first_state(self, link: HaplyLink) -> None:
        """Wait for the first answer."""
        deadline_ns = monotonic_ns() + round(CONNECT_S * 1e9)
        while link.state is None:
            if link.fault is not None:
                raise link.fault
            if monotonic_ns() > deadline_ns:
                raise DeviceTimeout(f"Haply's service sent no state within {CONNECT_S:g} s")
            sleep(PERIOD_S)

    def _read(self, now_ns: int) -> Reading:
        assert self._link is not None
        state = self._link.state
        if self._link.fault is not None:
            raise self._link.fault
        assert state is not None  # the device is open only from the first state on
        if now_ns - state.stamp_ns > STALL_NS:
            late_ms = (now_ns - state.stamp_ns) * 1e-6
            raise DeviceTimeout(f"Haply's service has not answered for {late_ms:.0f} ms")
        (right, forward, up), (v_right, v_forward, v_up) = state.position, state.velocity
        ready = state.usable and hypot(right, forward, up) <= self._radius
        stamp_ns = min(state.stamp_ns, now_ns)
        return Reading(stamp_ns, -forward, right, up, -v_forward, v_right, v_up, state.buttons, ready)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        assert self._link is not None
        towards, right, up = within(MAX_FORCE, fx, fy, fz)
        self._link.put((right, -towards, up))

    def _close(self) -> None:
        link, self._link = self._link, None
        if link is not None and not link.close() and link.fault is None:
            raise DeviceLost("Haply's service did not confirm the zero force before the connection was closed")


def _object_or_error(entry: Message, key: str) -> Message:
    """Return an object of the inventory."""
    try:
        return _object(entry, key)
    except MalformedMessage as error:
        raise DeviceError(f"Haply's service sent an inventory that is not as documented: {error}") from error


def _model_of(entry: Message) -> str:
    """Return the name of a device's model."""
    config = entry.get("config")
    kind = str(config.get("type", KINDS[0])) if isinstance(config, dict) else KINDS[0]
    return kind.capitalize()


def _require_usable(name: str, entry: Message) -> None:
    """Refuse a device that another program uses, or that has no power or calibration."""
    status = _object_or_error(entry, "status")
    if status.get("in_use"):
        raise DeviceNotFound(f"the Haply device {name} is in use by another program")
    if not status.get("power_supply"):
        raise DeviceError(f"the Haply device {name} has no power: connect its power supply and switch it on")
    if not status.get("calibrated"):
        raise DeviceError(
            f"the Haply device {name} is not calibrated: let it calibrate itself, or put the grip on the inkwell and "
            "wait for the light; docs/how-to/haply.md"
        )
