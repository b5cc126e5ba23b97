"""The registry of the protocol: every message under its number, with its limits and who sends it to whom.

Each message is one frozen dataclass, in the module of its senders. A message is data only;
`netboard.network.protocol.codec` converts it to bytes and back. Field order is wire order, so fields are only ever
appended, and `PROTOCOL_VERSION` grows when one is. All times are nanoseconds of the sender's monotonic clock unless a
field says "server time"; all other quantities are SI. PROTOCOL.md says when each is sent; its tables are made from
here, and so is what the server takes from a peer.
"""

from dataclasses import dataclass

from netboard.base.config import SIDES
from netboard.base.tables.questionnaires import MAX_ANSWER_BYTES, MAX_QUESTIONS
from netboard.network.protocol.control import (
    COMMANDS,
    Command,
    Outcomes,
    OutcomesRequest,
    Reply,
    Status,
    StatusRequest,
    Trace,
    TraceRequest,
)
from netboard.network.protocol.joining import ROLES, Goodbye, Hello, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.motion import (
    Backfill,
    BackfillRequest,
    Felt,
    Force,
    Heartbeat,
    Move,
    Point,
    Pointer,
    Stylus,
)
from netboard.network.protocol.records import (
    BackfillRecord,
    ClockRecord,
    EventRecord,
    FrameRecord,
    LogAck,
    LogBatch,
    LogEnd,
    LogRequest,
    TickRecord,
)
from netboard.network.protocol.station import ACTIONS, StationReport, StationRequest
from netboard.network.protocol.triggers import BoxState, InputPulse, PulseReport, Trigger
from netboard.network.protocol.views import MAX_SHOWN, Frames, QuestionnaireAnswers
from netboard.stage.view import View

PROTOCOL_VERSION = 9

Message = (
    Hello
    | Welcome
    | Refusal
    | Goodbye
    | Ping
    | Pong
    | Stylus
    | Force
    | Point
    | Heartbeat
    | BackfillRequest
    | Backfill
    | View
    | Frames
    | QuestionnaireAnswers
    | LogRequest
    | LogBatch
    | LogAck
    | LogEnd
    | TickRecord
    | EventRecord
    | ClockRecord
    | FrameRecord
    | BackfillRecord
    | Trigger
    | PulseReport
    | InputPulse
    | BoxState
    | Command
    | Reply
    | StatusRequest
    | Status
    | OutcomesRequest
    | Outcomes
    | TraceRequest
    | Trace
    | Move
    | Pointer
    | Felt
    | StationRequest
    | StationReport
)


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One row of `KINDS`.

    Attributes
    ----------
    message : type
        The message's dataclass.
    most_bytes : int
        Size of the largest frame [1].
    most_items : int
        Length of the longest array in a field; 0 for a message without arrays [1].
    most_pairs : int
        Pairs of the largest map in a field; 0 for a message without maps [1].
    up, down : tuple of str
        Roles of the peers that send it to the server, and of those that the server sends it to.
    """

    message: type[Message]
    most_bytes: int
    most_items: int = 0
    most_pairs: int = 0
    up: tuple[str, ...] = ()
    down: tuple[str, ...] = ()


_AGENT, _DISPLAY, _CONSOLE, _LOGGER = ("agent",), ("display",), ("console",), ("logger",)
_LOGGERS, _TRIGGER = ("logger", "listener"), ("trigger",)
_PINGED = ("display", "logger", "console", "listener", "trigger")

KINDS: dict[int, MessageKind] = {
    1: MessageKind(Hello, 4096, most_pairs=32, up=ROLES),
    2: MessageKind(Welcome, 262_144, down=ROLES),
    3: MessageKind(Refusal, 8192, down=ROLES),  # may quote anything of a Hello
    4: MessageKind(Goodbye, 4096, up=ROLES, down=ROLES),
    5: MessageKind(Ping, 64, down=_PINGED),
    6: MessageKind(Pong, 64, up=_PINGED),
    10: MessageKind(Stylus, 256, up=_AGENT),
    11: MessageKind(Force, 64, down=_AGENT),
    12: MessageKind(Heartbeat, 64, down=_AGENT),
    13: MessageKind(Point, 128, down=_AGENT),
    14: MessageKind(BackfillRequest, 64, down=_AGENT),
    15: MessageKind(Backfill, 2304, up=_AGENT),
    20: MessageKind(View, 4096, down=_DISPLAY),
    21: MessageKind(Frames, 8192, MAX_SHOWN, up=_DISPLAY),
    22: MessageKind(QuestionnaireAnswers, MAX_ANSWER_BYTES, most_pairs=MAX_QUESTIONS, up=_DISPLAY),
    30: MessageKind(LogRequest, 64, up=_LOGGERS),
    31: MessageKind(LogBatch, 1_048_576, 4096, down=_LOGGERS),
    32: MessageKind(LogAck, 1024, up=_LOGGER),
    33: MessageKind(LogEnd, 64, down=_LOGGERS),
    34: MessageKind(TickRecord, 4096),
    35: MessageKind(EventRecord, 65_536, most_pairs=4096),
    36: MessageKind(ClockRecord, 256),
    37: MessageKind(FrameRecord, 256),
    38: MessageKind(BackfillRecord, 2304),
    40: MessageKind(Trigger, 128, down=_TRIGGER),
    41: MessageKind(PulseReport, 2048, up=_TRIGGER),
    42: MessageKind(InputPulse, 64, up=_TRIGGER),
    43: MessageKind(BoxState, 2048, up=_TRIGGER),
    50: MessageKind(Command, 8192, up=_CONSOLE),
    51: MessageKind(StatusRequest, 16, up=_CONSOLE),
    52: MessageKind(Status, 262_144, 10_240, down=_CONSOLE),
    53: MessageKind(Reply, 4096, down=_CONSOLE),
    54: MessageKind(OutcomesRequest, 64, up=_CONSOLE),
    55: MessageKind(Outcomes, 65_536, 512, down=_CONSOLE),
    56: MessageKind(TraceRequest, 64, up=_CONSOLE),
    57: MessageKind(Trace, 65_536, 512, down=_CONSOLE),
    60: MessageKind(Move, 128),
    61: MessageKind(Pointer, 64),
    62: MessageKind(Felt, 64),
    70: MessageKind(StationRequest, 256),
    71: MessageKind(StationReport, 131_072, 32, most_pairs=32),
}
"""Messages by their numbers on the wire. Append only; 127 is the highest that MessagePack writes as one byte."""


def sent_by(role: str) -> frozenset[type[Message]]:
    """Return the messages that peers of a role send to the server."""
    return frozenset(kind.message for kind in KINDS.values() if role in kind.up)


CHOICES: dict[tuple[type[Message], str], tuple[str, ...]] = {
    (Hello, "role"): ROLES,
    (Hello, "side"): (*SIDES, ""),
    (View, "station"): SIDES,
    (Frames, "station"): SIDES,
    (QuestionnaireAnswers, "station"): SIDES,
    (FrameRecord, "station"): SIDES,
    (BackfillRecord, "side"): SIDES,
    (Command, "name"): COMMANDS,
    (Move, "side"): SIDES,
    (Pointer, "side"): SIDES,
    (Felt, "side"): SIDES,
    (StationRequest, "action"): ACTIONS,
    (StationReport, "side"): SIDES,
}
"""Fields that allow only some strings."""
