"""The agent's endpoint of the motion channel: says hello until welcomed, sends samples, keeps the newest answer.

Compiled code handles the frames that come a thousand times a second, from the sleep until they arrive on; all others
are decoded as messages. Nothing here waits longer than asked, or knows the device.
"""

import logging
from dataclasses import astuple
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import Pacer, now_ns
from netboard.base.compiled import Records, kernel, machine_code
from netboard.base.errors import WireError
from netboard.base.terminal.logs import RateLimitedLog
from netboard.base.tick import NEVER_NS, TICK_NS
from netboard.devices.contract.device import Reading
from netboard.network.protocol import fixed
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import HELLO_FIRST, HELLO_INTERVAL_NS, Goodbye, Hello, Refusal, Welcome
from netboard.network.protocol.motion import Backfill, BackfillRequest, Force, Heartbeat, Point, Stylus
from netboard.network.transport import fastpath, sockets
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES
from netboard.stage.blinding import ANOTHER_HOLDER

log = logging.getLogger(__name__)

REMEMBERED = 256
"""Samples whose stamps are remembered; an answer to an older one is never fresh, whatever the timeout [1]."""

GOODBYE_ATTEMPTS = 50
"""Attempts to send the goodbye after a lost device, one each millisecond: by then the server misses samples [1]."""

REFUSED_NS = 5_000_000_000
"""Time for which the server must refuse an agent before it gives up [ns].

An agent that replaces a crashed one is refused only until the server misses the samples of that one.
"""

REFUSAL_GAP_NS = 2_000_000_000
"""Time without a refusal after which the next one is a new one: the server repeats it once a second [ns]."""

UNANSWERED_NS = 10_000_000_000
"""Time without an answer of any server after which the log says what to check [ns]."""

_SAID_NS = 2**62
"""Stands for the time since which there is no answer, where nothing is to be said of it any more [ns]."""

NONE, FORCE, POINT, BEAT = range(4)
"""Kinds of the newest answer."""

NEWER = -4
"""Result of `wait_for_answer` beside those of `fastpath.receive_one`: the newest answer is a newer one [1]."""

_ANSWERS: tuple[Any, ...] = (None, Force, Point, Heartbeat)
_PACKERS: tuple[Any, ...] = (None, *map(fixed.packer_of, (Force, Point, Heartbeat)))
_LENGTH = len(fixed.POINT.markers)
_TICK, _SENT, _SEQ = fixed.places_of(Force, "tick", "sent_ns", "stylus_seq")  # the first words of every answer
_LEAD = (-1, *(fixed.places_of(kind, "lead_ns")[0] for kind in _ANSWERS[1:]))  # by its kind
(COMMANDED,), (MAY_ARM,) = fixed.places_of(Force, "force"), fixed.places_of(Heartbeat, "arm")
_SAMPLE = np.dtype(fixed.fields_of(Stylus))

LINK = np.dtype(
    [
        ("in_session", "<i8"),
        ("timeout_ns", "<i8"),
        ("kind", "<i8"),  # of the newest answer
        ("words", "<i8", (_LENGTH,)),  # of it: tick, time of sending, number of the sample that it answers, and more
        ("lead_ns", "<i8"),  # how long before the tick's deadline that sample had arrived [ns]
        ("heard_ns", "<i8"),  # when the newest answer was received, 0 for never [ns]
        ("received_ns", "<i8"),  # when the last fresh one was, or NEVER_NS [ns]
        ("sent", "<i8"),  # number of the newest sample
        ("looped", "<i8"),  # newest sample whose loop is closed
        ("loop_ns", "<i8"),  # how long that took [ns]
        ("stamps", "<i8", (REMEMBERED,)),  # of the last samples [ns]
        ("came", "<i8", (_LENGTH,)),  # words of the frame being read
    ]
)
"""State of a link, as its kernels see it."""


def empty() -> NDArray[Any]:
    """Return the state of a link without any message."""
    state = np.zeros(1, LINK)
    state[0]["received_ns"], state[0]["looped"] = NEVER_NS, -1
    return state


@kernel
def _is_fresh(link: Records, seq: int) -> bool:
    """Return whether the message just received answers a recent sample, or says that there is none.

    Messages that arrived while the agent stalled thus do not count as fresh.
    """
    state = link[0]
    if seq < 0:
        return True
    age_ns = state["heard_ns"] - state["stamps"][seq % REMEMBERED]
    return bool(state["sent"] - seq < REMEMBERED and age_ns < state["timeout_ns"])


@kernel
def take(link: Records, kind: int, now_ns: int) -> bool:
    """Take an answer, whose words are in ``came``; return False if it is not newer than the newest one."""
    state = link[0]
    if not state["in_session"] or (state["kind"] != NONE and state["came"][_TICK] <= state["words"][_TICK]):
        return False
    state["kind"], state["lead_ns"], state["heard_ns"] = kind, state["came"][_LEAD[kind]], now_ns
    fastpath.copy(state["words"], state["came"], _LENGTH)
    if _is_fresh(link, state["came"][_SEQ]):
        state["received_ns"] = now_ns
    return True


@kernel
def wait_for_answer(fast: Records, frame: NDArray[np.uint8], link: Records, until_ns: int) -> int:
    """Wait for a newer answer until a time [ns]; a time that is over: only look.

    A signal of the watched file is noted, and the file is not watched any more.

    Returns `NEWER`, `netboard.network.transport.fastpath.NOTHING` or ``FAILED``, or the size of a frame that Python
    must read.
    """
    came = link[0]["came"]
    while True:
        size = fastpath.receive_one(fast, frame)
        now = fastpath.now_ns(fast)
        if size >= 0:
            if fixed.read(frame[:size], fixed.FORCE, came):
                kind = FORCE
            elif fixed.read(frame[:size], fixed.POINT, came):
                kind = POINT
            elif fixed.read(frame[:size], fixed.HEARTBEAT, came):
                kind = BEAT
            else:
                return size
            if take(link, kind, now):
                return NEWER
            if now >= until_ns:  # however many old answers there are
                return fastpath.NOTHING
        elif size == fastpath.FAILED or now >= until_ns:
            return size
        elif fastpath.sleep(fast, until_ns - now):
            fast[0]["signalled"], fast[0]["watched"] = 1, NO_FILE


@kernel
def send_sample(
    fast: Records,
    frame: NDArray[np.uint8],
    link: Records,
    seq: int,
    stamp_ns: int,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
    buttons: int,
    safeguards: int,
    rendered: float,
) -> int:
    """Send a sample by `netboard.network.transport.fastpath.send_one`; without a session, only remember its stamp."""
    state = link[0]
    state["stamps"][seq % REMEMBERED], state["sent"] = stamp_ns, seq
    if not state["in_session"]:
        return fastpath.NOT_SENT
    samples = np.empty(1, _SAMPLE)
    sample, is_answered = samples[0], state["kind"] != NONE
    sample["seq"], sample["stamp_ns"] = seq, stamp_ns
    sample["x"], sample["y"], sample["z"], sample["vx"], sample["vy"], sample["vz"] = x, y, z, vx, vy, vz
    sample["buttons"], sample["safeguards"], sample["rendered"] = buttons, safeguards, rendered
    sample["force_tick"] = state["words"][_TICK] if is_answered else -1
    sample["force_sent_ns"] = state["words"][_SENT] if is_answered else 0
    sample["force_received_ns"], sample["loop_ns"] = state["heard_ns"], state["loop_ns"]
    sample["sent_ns"] = fastpath.now_ns(fast)
    fixed.write(frame, fixed.STYLUS, samples.view(np.int64))
    return fastpath.send_one(fast, frame)


@kernel
def close_loop(link: Records, at_ns: int) -> None:
    """Note that the newest answer was rendered, which closes the loop of the sample it was computed from."""
    state = link[0]
    # The server may compute several ticks from one sample; only the first answer to it closes its loop.
    seq = state["words"][_SEQ]
    if state["kind"] in (FORCE, POINT) and seq > state["looped"]:
        state["looped"] = seq
        state["loop_ns"] = at_ns - state["stamps"][seq % REMEMBERED]


class MotionLink:
    """The agent's endpoint of the motion channel.

    ``timeout_ns``: age of a sample from which an answer to it is not fresh. Kernels take ``fast``, ``frame``,
    ``sample`` and ``state``: the socket, buffers for what arrives and for what is sent, and the state (`LINK`).
    """

    def __init__(self, socket: sockets.Socket, hello: Hello, timeout_ns: int) -> None:
        self.block = ""  # configuration of the block that has begun; the reader empties it
        self.asked: BackfillRequest | None = None  # the server's open request about an interruption; see `answer`
        self._socket = socket
        self._path = fastpath.FastPath(socket)
        self.fast, self.frame, self.state = self._path.record, np.zeros(sockets.MAX_FRAME, np.uint8), empty()
        self.state[0]["timeout_ns"] = timeout_ns
        # The fields that Python reads every tick: a view of one is read ten times faster than a record's field.
        self._kind, self._lead_ns, self._heard_ns = (self.state[name].data for name in ("kind", "lead_ns", "heard_ns"))
        self.sample = np.zeros(fixed.STYLUS.size, np.uint8)
        self._send_sample, self._close_loop = send_sample, close_loop
        self.introduce(hello)
        self._hello_ns = -HELLO_INTERVAL_NS
        self.refusal = ""  # why the server has refused this agent for `REFUSED_NS`, so that it gives up
        self._logged = ""  # session that has its line in the log
        self._refused = ""
        self._refused_since_ns = self._refused_ns = -REFUSAL_GAP_NS
        self.server_silent = False  # whether it fell silent during the session
        self._unanswered_ns = 0  # when the first `Hello` without an answer was sent; 0: none [ns]
        self._invalid_messages = RateLimitedLog(log)

    @property
    def kind(self) -> int:
        """Kind of the newest answer: `NONE`, `FORCE`, `POINT` or `BEAT`."""
        return self._kind[0]

    @property
    def newest(self) -> Force | Point | Heartbeat | None:
        """The newest answer."""
        kind, words = self.kind, self.state[0]["words"]
        return None if kind == NONE else _ANSWERS[kind](*_PACKERS[kind].unpack_from(words.data))

    @property
    def may_arm(self) -> bool:
        """Whether the newest answer is a heartbeat that allows the device to be armed."""
        return self.kind == BEAT and bool(self.state[0]["words"][MAY_ARM])

    @property
    def lead_ns(self) -> int:
        """How long before a tick's deadline the sample had arrived that the newest answer answers [ns]."""
        return self._lead_ns[0]

    @property
    def answer_ns(self) -> int:
        """When the newest answer was received, 0 for never [ns]."""
        return self._heard_ns[0]

    @property
    def received_ns(self) -> int | None:
        """When the server's last fresh answer was received [ns]."""
        received_ns = int(self.state[0]["received_ns"])
        return None if received_ns == NEVER_NS else received_ns

    @property
    def loop_ns(self) -> int:
        """Sample-to-force latency of the newest closed loop, 0 for none yet [ns]."""
        return int(self.state[0]["loop_ns"])

    def introduce(self, hello: Hello) -> None:
        """Leave the session, and use this `Hello` from now on."""
        self._hello = encode(hello)
        self._set_session("")

    def warm(self) -> None:
        """Compile or load the kernels, so that the first tick is not late."""
        nowhere, state = fastpath.FastPath(None).record, empty()
        wait_for_answer(nowhere, self.frame, state, 0)
        take(state, BEAT, 0)
        self._send_sample = machine_code(send_sample, nowhere, self.sample, state, 0, 0, *(0.0,) * 6, 0, 0, 0.0)
        self._close_loop = machine_code(close_loop, state, 0)

    def send(self, seq: int, reading: Reading, safeguards: int, rendered: float) -> None:
        """Send a reading as a sample, and then a `Hello` if the server is silent.

        ``safeguards``, ``rendered``: as in `netboard.network.protocol.motion.Stylus`.
        """
        stamp_ns, x, y, z, vx, vy, vz, buttons, _ = reading
        said = self._send_sample(
            self.fast, self.sample, self.state, seq, stamp_ns, x, y, z, vx, vy, vz, buttons, safeguards, rendered
        )
        if said == fastpath.FAILED:
            self._path.raise_failure("motion")
        if stamp_ns - max(self.answer_ns, self._hello_ns) >= HELLO_INTERVAL_NS:
            self._hello_ns = stamp_ns
            if self._session and not self.server_silent:
                self.server_silent = True
                log.warning("the server has been silent for %g s: waiting for it", HELLO_INTERVAL_NS * 1e-9)
            self._note_unanswered(stamp_ns)
            sockets.send_or_renew(self._socket, self._hello)
        elif self.server_silent and self.answer_ns > self._hello_ns:
            self.server_silent = False
            log.info("the server answers again")

    def _note_unanswered(self, now: int) -> None:
        """Say once what to check if no server has answered for `UNANSWERED_NS`."""
        if self._session or self._refused:
            return
        self._unanswered_ns = self._unanswered_ns or now
        if now - self._unanswered_ns >= UNANSWERED_NS:
            self._unanswered_ns = _SAID_NS
            log.warning(
                "no answer from the server for %g s. If it runs: check [network] host and port, and this agent's key; "
                "netboard status names refused peers",
                UNANSWERED_NS * 1e-9,
            )

    def receive(self, until_ns: int = 0) -> bool:
        """Wait for a message until a time; return True if it is a newer answer."""
        return self.handle_found(wait_for_answer(self.fast, self.frame, self.state, until_ns))

    def handle_found(self, came: int) -> bool:
        """Handle what `wait_for_answer` has found; return True if it is a newer answer."""
        if came == fastpath.FAILED:
            self._path.raise_failure("motion")
        return came == NEWER or (came >= 0 and self._understand(self.frame[:came].tobytes()))

    def _understand(self, frame: bytes) -> bool:
        """Handle a message that is not a fixed-form force or point."""
        try:
            message = decode(frame)
        except WireError as error:
            self._invalid_messages.log(f"invalid message from the server: {error}")
            return False
        match message:
            case Force() | Point() | Heartbeat():
                return self._take(message)
            case BackfillRequest():
                self.asked = message
            case Welcome(session=session, config=block):
                self._enter(session)
                self.block = block
            case Goodbye(reason=reason):
                log.info("the server ended the connection: %s", reason)
                self._logged = ""
                self._set_session("")
            case Refusal(reason=reason) if reason == HELLO_FIRST:  # it has forgotten this agent: samples are in vain
                self._logged = ""
                self._set_session("")
            case Refusal(reason=reason):
                self._take_refusal(reason, now_ns())
        return False

    def _take_refusal(self, reason: str, now: int) -> None:
        """Take a refusal; the same one for `REFUSED_NS`, outside a session, is final."""
        if reason != self._refused or now - self._refused_ns > REFUSAL_GAP_NS:
            self._refused, self._refused_since_ns = reason, now
            log.warning("the server refuses this agent: %s", reason)
        self._refused_ns = now
        if not self._session and reason != TOO_MANY_MESSAGES and now - self._refused_since_ns >= REFUSED_NS:
            self.refusal = reason

    def answer(self, backfill: Backfill) -> None:
        """Answer the server's backfill request; if the queue is full, the server asks again."""
        self.asked = None
        sockets.send(self._socket, encode(backfill))

    def rendered(self, at_ns: int) -> None:
        """Note that the newest answer was rendered, which closes the loop of the sample it was computed from."""
        self._close_loop(self.state, at_ns)

    def part(self, reason: str) -> None:
        """Leave the session with a goodbye, trying again while samples fill the queue.

        To return with another holder is no news: the log then has no line of the session, because a blinded block would
        differ from others by it.
        """
        for _ in range(GOODBYE_ATTEMPTS):
            if sockets.send(self._socket, encode(Goodbye(reason))):
                break
            Pacer(now_ns() + TICK_NS).wait()
        self._set_session("")
        if reason != ANOTHER_HOLDER:
            self._logged = ""

    def leave(self, reason: str) -> None:
        """Say goodbye and close."""
        sockets.send(self._socket, encode(Goodbye(reason)))
        self._path.close()
        sockets.close_after_goodbye(self._socket)

    def _take(self, message: Force | Point | Heartbeat) -> bool:
        """Take an answer that did not come in its fixed form."""
        kind = _ANSWERS.index(type(message))
        _PACKERS[kind].pack_into(self.state[0]["came"].data, 0, *astuple(message))
        return take(self.state, kind, now_ns())

    def _enter(self, session: str) -> None:
        """Enter a session; in a new one nothing of the old one counts."""
        self._refused, self._unanswered_ns = "", _SAID_NS  # address and key are right
        if session != self._session:
            if session != self._logged:
                log.info("in session %s", session[:8])
            self._logged = session
            self._set_session(session)

    def _set_session(self, session: str) -> None:
        """Be in another session, or in none, without an answer."""
        self._session = session
        self.state[0]["in_session"] = session != ""
        self.state[0]["kind"] = NONE  # ticks of a new session count from 0: `take` would refuse them as older
