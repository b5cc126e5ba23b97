"""The golden frames: one or more examples of every message, as bytes and as a JSON twin, in tests/data/frames.

Run as a script, this writes missing files only: a golden frame never changes.
"""

import json
import math
import struct
from dataclasses import fields
from pathlib import Path
from typing import Any

from netboard.base.safeguards import Safeguard
from netboard.network.protocol import control, joining, motion, records, station, triggers, views
from netboard.network.protocol.codec import encode
from netboard.network.protocol.messages import KINDS, Message
from netboard.stage.view import View

FRAMES = Path(__file__).parent.parent / "data" / "frames"
SERVER_NS = 81_234_567_890_123
PEER_NS = 5_000_000_000_000

EXAMPLES: dict[str, Message] = {
    "hello-agent": joining.Hello(
        "agent", "left", 2, "lab-pc-1: 4711", "0.1.0", {"model": "virtual", "max_force": "3.3 N"}
    ),
    "hello-logger": joining.Hello("logger", "", 2, "", "0.1.0", {}),
    "welcome": joining.Welcome("7f3a9c52d1e84b06", 2, SERVER_NS, '[session]\nname = "S01"\n'),
    "refusal": joining.Refusal("the server speaks protocol 2, the agent 1"),
    "goodbye": joining.Goodbye("stopped by the operator: Schluß für heute"),
    "ping": joining.Ping(SERVER_NS),
    "pong": joining.Pong(SERVER_NS, PEER_NS + 300_000, PEER_NS + 305_000),
    "stylus": motion.Stylus(
        seq=123_456,
        stamp_ns=PEER_NS + 123_456_000_000,
        x=0.0005,
        y=-0.0005,
        z=0.0125,
        vx=0.0,
        vy=0.0,
        vz=-0.03125,
        buttons=0,
        safeguards=Safeguard.ARMED | Safeguard.CLAMPED,
        rendered=-0.735,
        force_tick=123_400,
        force_sent_ns=SERVER_NS,
        force_received_ns=PEER_NS + 123_455_600_000,
        sent_ns=PEER_NS + 123_456_020_000,
        loop_ns=1_250_000,
    ),
    "stylus-extremes": motion.Stylus(
        seq=2**63 - 1,
        stamp_ns=-(2**63),
        x=math.nan,
        y=math.inf,
        z=-math.inf,
        vx=-0.0,
        vy=5e-324,
        vz=1.7976931348623157e308,
        buttons=-1,
        safeguards=255,
        rendered=0.1,
        force_tick=-1,
        force_sent_ns=2**31,
        force_received_ns=-(2**31) - 1,
        sent_ns=2**32,
        loop_ns=65_535,
    ),
    "force": motion.Force(123_457, SERVER_NS + 57_000_000, 123_456, -0.735, 287_000),
    "point": motion.Point(
        123_457, SERVER_NS + 57_000_000, 123_456, PEER_NS + 57_120_000, 0.0105, -0.03125, 200.0, 2.0, 287_000
    ),
    "beat": motion.Heartbeat(123_460, SERVER_NS + 60_000_000, -1, 0, False),
    "beat-arm": motion.Heartbeat(123_464, SERVER_NS + 64_000_000, 123_462, 301_500, True),
    "view-dyadic": View(
        station="left",
        tick=123_457,
        sent_ns=SERVER_NS,
        phase="running",
        z=0.0105,
        theta=-0.0123,
        p=0.0875,
        target=-0.15,
        left=0.0125,
        right=None,
        trial=7,
        trials=60,
        failures=2,
        completion=3.412,
        best=2.987,
        notice="",
        seq=9876,
        share=0.0,
        block=3,
        blocks=18,
        rest=None,
    ),
    "view-no-ball": View(
        station="right",
        tick=0,
        sent_ns=SERVER_NS,
        phase="idle",
        z=0.0,
        theta=0.0,
        p=None,
        target=0.15,
        left=0.0,
        right=0.0,
        trial=1,
        trials=6,
        failures=0,
        completion=None,
        best=None,
        notice="Waiting for the left hand",
        seq=0,
        share=0.25,
        block=1,
        blocks=1,
        rest=12.5,
    ),
    "frames": views.Frames(
        "right", ((123_440, PEER_NS, PEER_NS + 4_000_000), (123_457, PEER_NS + 17_000_000, PEER_NS + 21_000_000)), 3
    ),
    "frames-none": views.Frames("left", (), 0),
    "form-answers": views.QuestionnaireAnswers(
        "right", 3, {"person.opinion": "a program", "person.confidence": "62", "person.why": ""}, 12.5, True
    ),
    "log-request": records.LogRequest(-1),
    "log-batch": records.LogBatch(4096, 12, (bytes.fromhex("9222c403010203"), b"")),
    "log-ack": records.LogAck(4098, 512_000_000_000, "S01_D01_20260102T030405Z_7f3a9c52_block03.mcap", 1_048_576),
    "log-end": records.LogEnd(60_123),
    "tick-record": records.TickRecord(bytes(range(256)) * 2),
    "event-record": records.EventRecord(17, 123_457, SERVER_NS, "agent_joined", {"side": "left", "name": "lab-pc-1"}),
    "clock-record": records.ClockRecord(
        120, "agent.left", SERVER_NS, PEER_NS, PEER_NS + 400_000, SERVER_NS + 520_000, PEER_NS - SERVER_NS, 60_001, 3.25
    ),
    "frame-record": records.FrameRecord(5210, "left", 123_457, PEER_NS, PEER_NS + 4_000_000, 3),
    "command": control.Command("start", "", 1),
    "command-note": control.Command("note", '{"text": "sneezed", "tick": 1234}', 2),
    "reply": control.Reply(1, False, "cannot start without the left agent"),
    "outcomes-request": control.OutcomesRequest(12),
    "outcomes": control.Outcomes(
        12, ((3, 7, 1, "fell", math.nan, "", 0), (3, 7, 2, "success", 3.412, "late_ticks,clipped", 4))
    ),
    "trace-request": control.TraceRequest(-1),
    "trace": control.Trace(((123_455, 0.0125, -0.0125, 0.0105, -0.0123, 0.0875, -0.735, 0.25),)),
    "status-request": control.StatusRequest(),
    "status": control.Status(
        session="7f3a9c52d1e84b06",
        tick=123_457,
        phase="holding",
        trial=3,
        trials=6,
        successes=2,
        failures=1,
        completions=(3.412, 2.987),
        late_ticks=4,
        waiting_for=("display.right",),
        peers=("agent.left", "agent.right", "logger"),
        notice="",
        links=(
            ("agent.left", "lab-pc-1:4711", "0.2.0", 0.0004, 0.000118, 0.000059, 3.25, 999.8, 0),
            ("logger", "lab-pc-3:88", "0.2.0", 0.11, 0.000431, 0.000217, math.nan, 5.0, 2),
        ),
        loops=(("agent.left", 0.00087, 0.008),),
        name="S01",
        dyad="D03",
        study="paper",
        pilot=False,
        consent=True,
        opened=True,
        armed=True,
        commander="lab-pc-2:4242",
        block=3,
        blocks=18,
        label="bimanual A, haptics on",
        condition="bimanual, force full",
        rest=0.0,
        pending="pause after this trial",
        outcomes=14,
        recordings=(("S01_D03_20260102T030405Z_7f3a9c52_block03.mcap", 0.18, 1_048_576, 512_000_000_000),),
        stations=(("left", 0.0004, 1, -0.735, 0, 2), ("right", math.nan, 0, 0.0, 0, 0)),
        refused=(
            ("handshake", "its key is not known here", 400),
            ("control", "it has not joined yet", 3),
        ),
        lost=(2, 5),
        repeats=(1,),
        devices=(
            ("left", "haptic", "Touch", "4711", "haptic device: Touch, serial 4711 (never calibrated)"),
            ("right", "simulated", "virtual Touch", "virtual-right", "simulated, no device: virtual Touch"),
        ),
        displays=(("left", "xcb"), ("right", "offscreen")),
        stand_ins=(("right device simulated", True), ("right display off screen", False)),
        ahead=("bimanual B, haptics on", "dyadic, haptics off"),
    ),
    "backfill-request": motion.BackfillRequest(123_457, 131_072),
    "backfill": motion.Backfill(
        123_457,
        123_459,
        struct.pack("<qqdq", 123_457, PEER_NS + 123_457_000_000, -0.735, Safeguard.ARMED)
        + struct.pack("<qqdq", 123_458, PEER_NS + 123_458_000_000, -0.5, Safeguard.ARMED | Safeguard.STALE),
    ),
    "backfill-none": motion.Backfill(123_457, 131_072, b""),
    "backfill-record": records.BackfillRecord(
        3, "left", PEER_NS - SERVER_NS, struct.pack("<qqdq", 123_457, PEER_NS + 123_457_000_000, -0.735, 1)
    ),
    "move": motion.Move("right", -0.0125, 0.313, 0.021),
    "pointer": motion.Pointer("left", -0.0215),
    "pointer-none": motion.Pointer("right", None),
    "felt": motion.Felt("left", -0.294),
    "station-request": station.StationRequest("start", "left agent"),
    "station-report": station.StationReport(
        "left",
        "0.1.0",
        {"computer": "lab-pc-2", "screen": "opens"},
        (
            station.ProcessStatus("left agent", "running", None, 4711, 12.5, 2048),
            station.ProcessStatus("left display", "ended", 1, 4712, 3.0, 512),
        ),
        {"left display": "there is no screen"},
        "",
    ),
    "trigger": triggers.Trigger(17, 4012, SERVER_NS, "held", 4),
    "pulse-report": triggers.PulseReport(
        17, PEER_NS + 210_000, PEER_NS + 260_000, PEER_NS + 5_300_000, PEER_NS + 905_000, 0, ""
    ),
    "pulse-report-lost": triggers.PulseReport(18, PEER_NS, 0, 0, 0, 0, "the serial box at /dev/ttyACM0 was unplugged"),
    "input-pulse": triggers.InputPulse(255, PEER_NS),
    "box-state": triggers.BoxState(True, "serial box at /dev/ttyACM0", False, ""),
    "box-state-lost": triggers.BoxState(False, "parallel port /dev/parport0", False, "/dev/parport0: no such port"),
}


def as_json(value: Any) -> Any:
    """Value as a JSON twin holds it: bytes as hexadecimal digits, non-finite numbers as strings."""
    match value:
        case bytes():
            return value.hex()
        case float() if not math.isfinite(value):
            return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
        case tuple():
            return [as_json(item) for item in value]
        case int() if not isinstance(value, bool):
            return int(value)
    return value


def twin(message: Message) -> dict[str, Any]:
    """The JSON twin of a message."""
    number = next(number for number, kind in KINDS.items() if kind.message is type(message))
    values = {field.name: as_json(getattr(message, field.name)) for field in fields(message)}
    return {"kind": number, "message": type(message).__name__, "fields": values}


def main() -> None:
    """Write the files that are missing."""
    FRAMES.mkdir(parents=True, exist_ok=True)
    for name, message in EXAMPLES.items():
        path = FRAMES / f"{name}.bin"
        if path.exists():
            continue
        path.write_bytes(encode(message))
        text = json.dumps(twin(message), indent=2, ensure_ascii=False) + "\n"
        path.with_suffix(".json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
