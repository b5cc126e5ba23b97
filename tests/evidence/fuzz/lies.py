"""Files that lie about themselves: each field of a recording, of its journal, tables and keys, with limits of its kind.

`cases` lists them by kind. Each is valid MCAP, JSON, MessagePack, TOML or CSV with right checksums; one thing in it
is at or beyond a limit: missing, of another kind, negative, huge, cut, repeated, or nested. Fields get the limits in
turn, so that each field and each limit is in some file, without all their pairs.
"""

import json
import math
import random
import shutil
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import lz4.frame
import msgpack
import numpy as np
import zstandard
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from evidence.fuzz.container import Container, Inside, Lie, unpacked
from netboard.base.config import SIDES
from netboard.base.files.cells import CsvWriter
from netboard.base.tick import TICK
from netboard.network import keys
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import EventRecord, LogBatch, TickRecord
from netboard.recording.files.provenance import CONFIG_NAME, MetadataName
from netboard.recording.files.reader import Recording
from netboard.recording.format.batches import ATTEMPTS_NAME, PLACES_NAME, pack
from netboard.recording.format.chunks import MAGIC
from netboard.recording.format.predictions import CONSTANTS
from netboard.recording.recovery import spill

SOURCE = Path(__file__).parents[2] / "data" / "sessions" / "live-session.mcap"
"""A live session of one trial with simulated devices, which `check` finds complete."""

NAME = "S01_D01_20261129T015427Z_3f402c28"
MISSING = object()

NUMBERS = (0, -1, 2**31, 2**32 - 1, 2**53, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
TEXTS = (
    *("", "-1", "9" * 6000, "1e999", "nan", "\0", "\x1b[2J\x1b[31m\n", "x" * 100_000, "../../../tmp/x", "/dev/zero"),
    *("\u202e", "[" * 5000, "=1+1", "٣"),
)
VALUES: tuple[Any, ...] = (
    *(MISSING, None, True, *NUMBERS, 0.5, math.nan, math.inf, 1e308, *TEXTS[:8]),
    *([], {}, [[]] * 1000, {"a": {"b": {}}}, [0] * 100_000),
)


@dataclass(frozen=True)
class Case:
    """A file and how it is made in a new folder."""

    kind: str
    name: str
    make: Callable[..., Path]


def in_turn(places: Iterable[Any], limits: Sequence[Any], each: int) -> Iterator[tuple[Any, Any]]:
    """Yield places, each with some of the limits, which take turns."""
    for number, place in enumerate(places):
        for k in range(each):
            yield place, limits[(number * each + k) % len(limits)]


def paths_in(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of each value of JSON or MessagePack; of a list, of its first and last item."""
    if path:
        yield path
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        if not isinstance(tree, list) or key in (0, len(tree) - 1):
            yield from paths_in(value, (*path, key))


def with_value(tree: Any, path: tuple[Any, ...], value: Any) -> Any:
    """Return a copy of a tree with another value in one place."""
    changed = deepcopy(tree)
    inner = changed
    for key in path[:-1]:
        inner = inner[key]
    if value is MISSING:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return changed


def nested(depth: int) -> str:
    """Return JSON lists within lists."""
    return "[" * depth + "]" * depth


def lying_texts(text: str) -> Iterator[str]:
    """Yield forms of a JSON text that no value has."""
    yield from ("", text[: len(text) // 2], nested(100_000), "\ufeff" + text, text.replace('"', "'"), "null")
    yield text.replace(": ", ": [", 1)
    yield text.replace("{", '{"np": 1, "np": 2, ', 1)
    yield text.replace("0", "9" * 6000, 1)


def in_json(text: bytes, each: int) -> Iterator[tuple[str, bytes]]:
    """Yield lies about each value of a JSON text, and about its form."""
    tree = json.loads(text)
    for path, value in in_turn(paths_in(tree), VALUES, each):
        yield f"{path} {value!r:.30}", json.dumps(with_value(tree, path, value)).encode()
    for number, form in enumerate(lying_texts(text.decode())):
        yield f"form {number}", form.encode()


# --- recordings ------------------------------------------------------------------------------------------------------

RECORDS = (
    *(Header, Metadata, Attachment, Chunk, Schema, Channel, Message, Statistics),
    *(ChunkIndex, AttachmentIndex, MetadataIndex, Footer),
)


@cache
def _source() -> Container:
    return Container.read(SOURCE)


def source() -> Container:
    """Return the recording, to be changed."""
    return deepcopy(_source())


def _file(place: Path, data: bytes, ending: str = ".mcap") -> Path:
    path = place / (NAME + ending)
    path.write_bytes(data)
    return path


def written(change: Callable[..., object], lie: Lie = lambda record: record) -> Callable[..., Path]:
    """Return the maker of a recording with a change."""

    def make(place: Path) -> Path:
        container = source()
        change(container)
        return _file(place, container.assembled(lie))

    return make


def unchanged(container: Container) -> None:
    """Change nothing."""


def lie_in_field(kind: type[McapRecord], name: str, value: Any, number: int) -> Lie:
    """Return the lie that a field of some records of a kind has a value: of each, the first or the second."""
    seen = iter(range(10**9))

    def lie(record: McapRecord) -> McapRecord:
        return replace(record, **{name: value}) if type(record) is kind and number in (2, next(seen)) else record

    return lie


def fields_of_records() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies about the fields of the records of MCAP."""
    limits = {
        int: NUMBERS[:1] + NUMBERS[2:],
        str: TEXTS,
        bytes: (b"", b"\xc1", b"\xdd\xff\xff\xff\xff", b"\x91" * 2000, b"\0" * 2**20),
    }
    for wanted, allowed in limits.items():
        places = [(kind, one.name) for kind in RECORDS for one in fields(kind) if one.type is wanted]
        sound = [place for place in places if "crc" not in place[1]]
        for number, ((kind, name), value) in enumerate(in_turn(sound, allowed, 4)):
            lie = lie_in_field(kind, name, value, number % 3)
            yield f"{kind.__name__}.{name} {value!r:.30}", written(unchanged, lie)


def json_in(what: Callable[..., Any], each: int) -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in the JSON text of a record."""
    for name, data in in_json(what(source()).data, each):
        yield name, written(lambda container, data=data: setattr(what(container), "data", data))


def ticks_schema(container: Container) -> Any:
    """Return the schema of the ticks."""
    return next(one for one in container.summary if isinstance(one, Schema) and b'"columns"' in one.data)


def metadata() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in the metadata: values, keys, and records."""
    names = [(one.name, key) for one in source().records if isinstance(one, Metadata) for key in one.metadata]
    for (name, key), text in in_turn(names, (MISSING, *TEXTS), 2):
        change = {key: text}
        if text is MISSING:
            yield f"no {key}", written(lambda c, name=name, key=key: c.metadata(name).pop(key))
        else:
            yield f"{key} {text!r:.30}", written(lambda c, name=name, change=change: c.metadata(name).update(change))
    many = {f"key {k}": "x" for k in range(20_000)}
    yield "20000 keys", written(lambda c: c.metadata(MetadataName.OPENED).update(many))


def list_of_places() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in the list of places."""
    for number, value in in_turn(range(4), NUMBERS, len(NUMBERS)):
        yield f"{number} {value}", written(lambda c, n=number, v=value: c.places[1].__setitem__(n, v))
    yield "repeated", written(lambda c: setattr(c, "places", c.places[:1] * 1000))
    yield "cut", written(lambda c: setattr(c, "places", c.places[:2]))
    yield "none", written(lambda c: setattr(c, "places", []))
    yield "garbage", written(lambda c: setattr(c.attachment(PLACES_NAME), "data", b"!" * 3200))


def messages() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in a message of each channel."""
    garbage = (b"", b"\xc1", b"\xdd\xff\xff\xff\xff", b"\x91" * 2000, b"\xdc\xff\xff" * 1000)
    for topic in [one.topic for one in source().summary if isinstance(one, Channel) and source().of(one.topic)]:
        values = unpacked(source().of(topic)[1])
        forms = [(f"{data!r:.30}", data) for data in garbage]
        for path, value in in_turn(paths_in(values), VALUES, 2):
            if not isinstance(value, int) or value < 2**64:
                forms.append((f"{path} {value!r:.30}", msgpack.packb(with_value(values, path, value))))
        for name, data in forms:
            yield f"{topic} {name}", written(lambda c, t=topic, d=data: setattr(c.of(t)[1], "data", d))


DETAILS: dict[str, dict[str, str]] = {
    "log_lost": {"first": "3", "count": "2", "cause": "x", "after_tick": "5"},
    "log_unreadable": {"number": "3", "reason": "x", "hex": "00"},
    "stood_still": {"milliseconds": "3"},
    "attempt_ended": {"trial": "1", "attempt": "1", "outcome": "success", "flags": "", "repeats": "0"},
    "held": {"completion": "1.5"},
    "command": {"name": "note", "argument": '{"text": "a", "tick": 3}'},
    "block_began": {"config": "[session]\n"},
    "agent_joined": {"side": "left", "device": "touch", "serial": "1", "model": "x"},
    "pause": {"notice": "x"},
}


def details_of_events() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in the details of events whose details are read."""
    places = [(name, key) for name, details in DETAILS.items() for key in details]
    for (name, key), value in in_turn(places, (MISSING, *TEXTS), 2):
        details = with_value(DETAILS[name], (key,), value)
        event = {"seq": 15, "tick": 4000, "time_ns": 10**12, "name": name, "details": details}

        def change(container: Container, event: dict[str, Any] = event) -> None:
            last = container.of("/event")[-1]
            container.chunks[-1].records.append(replace(last, sequence=15, data=msgpack.packb(event)))

        yield f"{name} {key} {value!r:.30}", written(change)


def values_of_ticks() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield impossible values in a column of a batch, encoded as it should be."""
    with Recording(SOURCE) as recording:
        rows = recording.ticks(as_sent=True)
    message = unpacked(source().of("/ticks")[1])
    first = unpacked(source().of("/ticks")[0])["count"]
    for number, name in enumerate(TICK.names or ()):
        limits = (
            (-1, 2**62, 2**63 - 1, -(2**63), 10**9)
            if TICK[name].kind == "i"
            else (math.nan, math.inf, 1e308, -1e9, 5e-324)
        )
        mine = rows[first : first + message["count"]].copy()
        mine[name][slice(None) if number % 2 else 7] = limits[number % 5]
        lying = message | {"columns": pack(mine, dict(zip(CONSTANTS, message["constants"], strict=True)))}
        data = msgpack.packb(lying)
        yield (
            f"{name} {limits[number % 5]}",
            written(lambda c, data=data: setattr(c.of("/ticks")[1], "data", data)),
        )


CONFIG_VALUES = ("9" * 6000, "1e308", "nan", "-1", "0", "true", '"x"', nested(2000), "[]", "{}", "10000", "[1, 2, 3]")


def configuration() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in each line of the configuration, whose checksum fits."""
    text = source().attachment(CONFIG_NAME).data.decode()
    lines = text.splitlines()
    places = [number for number, line in enumerate(lines) if " = " in line]
    for place, value in in_turn(places, CONFIG_VALUES, 1):
        key = lines[place].partition(" = ")[0]
        data = "\n".join([*lines[:place], f"{key} = {value}", *lines[place + 1 :]]).encode()
        yield f"{key} = {value:.30}", written(lambda c, data=data: c.set_config(data))
    for name, data in {
        "not UTF-8": text.encode() + b"\xff\xfe",
        "cut": text[: len(text) // 2].encode(),
        "twice": text.encode() * 2,
        "long key": f"{'a.' * 5000}b = 1\n{text}".encode(),
        "empty": b"",
    }.items():
        yield name, written(lambda c, data=data: c.set_config(data))


def stored_chunks() -> dict[str, Chunk]:
    """Return chunks that expand, do not unpack, or are not what the index says."""
    zeros = bytes(2**27)
    packed, message = zstandard.compress(zeros), struct.pack("<BQHIQQ", 5, 22 + 2**20, 1, 0, 0, 0) + bytes(2**20)
    stored = {
        "zstd that expands": ("zstd", packed, len(zeros)),
        "size of 2**50": ("zstd", packed, 2**50),
        "cut zstd": ("zstd", packed[:-5], len(zeros)),
        "lz4 that does not unpack": ("lz4", b"this is not lz4 at all" * 100, 300_000),
        "lz4 that expands": ("lz4", lz4.frame.compress(zeros), len(zeros)),
        "lz4 larger than it says": ("lz4", lz4.frame.compress(zeros), 10),
        "empty lz4": ("lz4", b"", 0),
        "empty zstd": ("zstd", b"", 0),
        "length of a record of 2**63": ("", b"\x05\xff\xff\xff\xff\xff\xff\xff\x7f", 9),
        "short message": ("", b"\x05" + struct.pack("<Q", 3) + b"abc", 12),
        "large messages": ("zstd", zstandard.compress(message * 30), len(message) * 30),
        "unknown compression": ("brotli", packed, len(zeros)),
        "control characters": ("zstd\n\x1b[31m", packed, len(zeros)),
    }
    return {name: Chunk(word, data, 10**18, 0, 0, size) for name, (word, data, size) in stored.items()}


def chunks() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield lies in a chunk as it is stored."""
    for number, (name, chunk) in enumerate(stored_chunks().items()):
        yield name, written(lambda c, n=number % 3, one=chunk: setattr(c.chunks[n], "stored", one))


def records() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield recordings whose records are missing, repeated, or in another order."""
    for kind in (Header, Metadata, Attachment, Inside):
        yield f"no {kind.__name__}", written(lambda c, k=kind: _keep(c.records, lambda one: not isinstance(one, k)))
        yield f"2 {kind.__name__}", written(lambda c, k=kind: c.records.extend(_all(c.records, k)))
        yield f"1 {kind.__name__}", written(lambda c, k=kind: c.records.remove(_all(c.records, k)[-1]))
    for number in range(len(source().summary)):
        yield f"no summary record {number}", written(lambda c, n=number: c.summary.pop(n))
    for index in (ChunkIndex, AttachmentIndex, MetadataIndex):
        for count in (0, 2, 3000):
            yield f"{count} {index.__name__}", written(lambda c, k=index, n=count: c.repeat.update({k: n}))
    yield "3000 records of the summary", written(lambda c: setattr(c, "summary", c.summary * 200))
    yield "reversed", written(lambda c: c.records.reverse())
    yield "2000 metadata", written(lambda c: c.records.extend(_all(c.records, Metadata) * 700))


def _keep(found: list[Any], wanted: Callable[[Any], bool]) -> None:
    found[:] = [one for one in found if wanted(one)]


def _all(found: list[Any], kind: type) -> list[Any]:
    return deepcopy([one for one in found if isinstance(one, kind)])


def lengths() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield recordings in which a record states another length."""
    data, at, seen = source().assembled(), len(MAGIC), set[int]()
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode not in seen:
            seen.add(opcode)
            for value in (0, length - 1, 2**32, 2**63 - 1, 2**64 - 1):
                lying = data[: at + 1] + struct.pack("<Q", value) + data[at + 9 :]
                yield f"opcode {opcode}: {value}", lambda place, lying=lying: _file(place, lying)
        at += 9 + length


# --- files other than recordings -------------------------------------------------------------------------------------


def spills() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield a server's spills whose blocks are whole, and whose messages lie."""
    with Recording(SOURCE) as recording:
        text, rows = recording.config_text, recording.ticks(0, 40)
    frames = [encode(TickRecord(row.tobytes())) for row in rows]
    late = rows.copy()
    late["time_ns"][7] = -(2**63)
    welcome, opened = Welcome("3f402c2800000000", 1, 7, text), {"utc_ns": "1790000000000000000"}
    whole: list[Any] = [welcome, EventRecord(0, 0, 0, spill.OPENED, opened), LogBatch(0, 0, tuple(frames))]

    def of(parts: Sequence[Any]) -> Callable[..., Path]:
        data = spill.MAGIC + b"".join(spill.block_of(encode(part)) for part in parts)
        return lambda place: _file(place, data, ".spill")

    yield "sound", of(whole)
    for value in (0, -(2**63), 2**63 - 1):
        yield f"start {value}", of([replace(welcome, server_ns=value), *whole[1:]])
        yield f"number {value}", of([*whole, LogBatch(value, 0, tuple(frames))])
        yield f"opened {value}", of([welcome, EventRecord(0, 0, value, spill.OPENED, opened), whole[2]])
    for word in TEXTS[:8]:
        yield (
            f"utc_ns {word!r:.30}",
            of([welcome, EventRecord(0, 0, 0, spill.OPENED, {"utc_ns": word[:20_000]}), *whole[2:]]),
        )
    for word in (nested(900), "", "x = " + nested(900)):
        yield f"configuration {word:.20}", of([replace(welcome, config=word), *whole[1:]])
        began = encode(EventRecord(1, 3, 5, "block_began", {"config": word}))
        yield (
            f"configuration of a block {word:.20}",
            of([*whole[:2], LogBatch(0, 0, (*frames[:7], began, *frames[7:]))]),
        )
    yield "short tick", of([*whole[:2], LogBatch(0, 0, (*frames, encode(TickRecord(b"short"))))])
    yield "negative time", of([*whole[:2], LogBatch(0, 0, tuple(encode(TickRecord(row.tobytes())) for row in late))])
    yield "reversed", of(whole[::-1])


HEADER = {
    **{"entry": "header", "format": 1, "session": 1, "dyad": "D01", "name": "S01", "study": "paper", "seed": 1},
    **{"study_digest": "x", "plan_digest": "x", "config": "", "config_digest": "", "netboard": "0.1.0", "pilot": False},
}
ENTRY = {"entry": "attempt_ended", "trial": 1, "attempt": 1, "block": 1}


def journals() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield journals of lies beside a sound recording."""

    def of(*lines: bytes) -> Callable[..., Path]:
        def make(place: Path) -> Path:
            (place / "D01_S01.journal.jsonl").write_bytes(b"\n".join(lines) + b"\n")
            return _file(place, SOURCE.read_bytes())

        return make

    header, entry = json.dumps(HEADER).encode(), json.dumps(ENTRY).encode()
    for name, text in in_json(header, 2):
        yield f"header {name}", of(text, entry)
    for name, text in in_json(entry, 3):
        yield f"entry {name}", of(header, text, entry)


def unfinished() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield unfinished recordings with many chunks and records that contain each other."""
    data, name = source().assembled(), struct.pack("<I", 8) + b"netboard"
    chunk = b"\x06" + struct.pack("<QQQQI", 60, 0, 0, 1000, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", 15)
    record = b"\x0c" + struct.pack("<Q", 2**20) + name
    whole = b"\x0c" + struct.pack("<Q", len(name) + 4) + name + struct.pack("<I", 0)
    for number, garbage in enumerate((chunk, record, whole + b"\xff", chunk + record)):
        for at in (len(MAGIC), len(data) // 2, len(data) - 100):
            lying = data[:at] + garbage * 4000 + data[at:] * (number % 2)
            yield f"{number} at {at}", lambda place, lying=lying: _file(place, lying, ".mcap.part")


def folders() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield folders whose files contradict each other; the recording itself is sound."""

    def of(fill: Callable[[Path, Path], object]) -> Callable[..., Path]:
        def make(place: Path) -> Path:
            path = _file(place, SOURCE.read_bytes())
            fill(place, path)
            return path

        return make

    yield "copy", of(lambda place, path: shutil.copyfile(path, place / "copy.mcap"))
    yield "also unfinished", of(lambda place, path: shutil.copyfile(path, path.with_suffix(".mcap.part")))
    yield "also a spill", of(lambda place, path: path.with_suffix(".spill").write_bytes(spill.MAGIC))
    yield "loop", of(lambda place, path: (place / "loop").symlink_to(place))
    yield "dangling link", of(lambda place, path: (place / "gone.mcap").symlink_to(place / "nothing"))
    yield "folder with the name of a recording", of(lambda place, path: (place / "folder.mcap").mkdir())
    yield "empty recording", of(lambda place, path: (place / "empty.mcap").touch())
    yield "no recording", of(lambda place, path: (place / "text.mcap").write_text("hello\n" * 1000))
    yield "journal without end", of(lambda place, path: (place / "D01_S01.journal.jsonl").symlink_to("/dev/zero"))
    yield "endless recording", of(lambda place, path: (place / "zero.mcap").symlink_to("/dev/zero"))
    yield "name with control characters", of(lambda place, path: shutil.copyfile(path, place / "\x1b[2J\n.mcap"))
    yield "300 files", of(lambda place, path: [(place / f"{k}.mcap").write_bytes(MAGIC) for k in range(300)])


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]], name: str) -> Callable[..., Path]:
    def make(place: Path) -> Path:
        path = place / f"{name}.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            CsvWriter(file).rows([head, *rows])
        return path

    return make


CELLS = (*TEXTS, "1_1", "0x10", "1e", "1,5", "2.01921E+12", "True", str(2**63), "3.0", "inf", "1e308", "-0.5")


def tick_tables() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield exported tables of ticks with a lie in a cell of each column."""
    with Recording(SOURCE) as recording:
        rows = [list(row) for row in recording.ticks(0, 200).tolist()]
    head = list(TICK.names or ())
    for column, value in in_turn(range(len(head)), CELLS, 1):
        changed = [*rows[:5], [*rows[5][:column], value, *rows[5][column + 1 :]], *rows[6:]]
        yield f"{head[column]} {value!r:.30}", _table(head, changed, "ticks")
    yield "row cut", _table(head, [*rows[:5], rows[5][:9]], "ticks")
    yield "no rows", _table(head, [], "ticks")
    yield "columns twice", _table(head * 2, [row * 2 for row in rows], "ticks")


HANDS = ("t", "z_left", "v_left", "z_right", "v_right")


def hand_tables() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield files of hand movements with a lie in a cell of each column, or in the form of the table."""
    time = np.arange(200) / 1000
    rows = np.stack([time, 0.01 * np.sin(time), 0.01 * np.cos(time), -0.01 * np.sin(time), -0.01 * np.cos(time)], 1)
    sound = rows.tolist()
    for column, value in in_turn(range(5), CELLS, 6):
        changed = [*sound[:5], [*sound[5][:column], value, *sound[5][column + 1 :]], *sound[6:]]
        yield f"{HANDS[column]} {value!r:.30}", _table(HANDS, changed, "hands")
    text = "\n".join([",".join(HANDS), *(",".join(map(repr, row)) for row in sound)])
    for name, data in {
        "UTF-16": text.encode("utf-16"),
        "NUL": text.replace(",", "\0", 40).encode(),
        "open quote": text.replace(",", ',"', 40).encode(),
        "one line of 10 MB": (text + "," + "1" * 10**7).encode(),
        "no head": text.partition("\n")[2].encode(),
        "empty": b"",
        "not UTF-8": text.encode() + b"\n\xff",
        "Parquet by name": b"",
    }.items():
        ending = ".parquet" if name.startswith("Parquet") else ".csv"
        yield name, lambda place, data=data, ending=ending: _file(place, data, ending)


def key_files() -> Iterator[tuple[str, Callable[..., Path]]]:
    """Yield folders of keys with a lie in the list of peers or in a key file; the path is that of a configuration."""
    values = ("0", "-1", "nan", '""', f'"{"x" * 100_000}"', '"\\u001b[2J"', "true", nested(2000), "1999-01-01", "{}")
    for name in (keys.LIST, "agent.left.key", "server.key"):
        for number in range(40):
            yield f"{name} {number}", _keys(name, number, values)


def _keys(name: str, number: int, values: Sequence[str]) -> Callable[..., Path]:
    def make(place: Path) -> Path:
        folder = place / "keys"
        keys.init(folder)
        for side in SIDES:
            keys.add(folder, "agent", side, folder)
        path = folder / name
        lines = path.read_text().splitlines()
        where = [k for k, line in enumerate(lines) if " = " in line]
        at = where[number % len(where)]
        key = lines[at].partition(" = ")[0]
        forms: tuple[list[str], ...] = ([f"{key} = {values[number % len(values)]}"], [], [lines[at]] * 2)
        changed = forms[0 if number % 7 else 1 + number % 2]
        path.write_text("\n".join([*lines[:at], *changed, *lines[at + 1 :]]))
        config = place / "rig.toml"
        config.write_text(f'[network]\nkeys = "{folder}"\nbind = "0.0.0.0"\nhost = "10.0.0.1"\ncurve = "on"\n')
        return config

    return make


KINDS: dict[str, Callable[[], Iterator[tuple[str, Callable[..., Path]]]]] = {
    "fields of the records": fields_of_records,
    "schema of the ticks": lambda: json_in(ticks_schema, 1),
    "list of attempts": lambda: json_in(lambda c: c.attachment(ATTEMPTS_NAME), 3),
    "metadata": metadata,
    "list of places": list_of_places,
    "messages": messages,
    "details of events": details_of_events,
    "values of ticks": values_of_ticks,
    "configuration": configuration,
    "chunks": chunks,
    "missing, repeated records": records,
    "lengths of records": lengths,
    "spill": spills,
    "journal": journals,
    "unfinished file": unfinished,
    "folder": folders,
    "table of ticks": tick_tables,
    "table of hands": hand_tables,
    "keys": key_files,
}
"""What lies in a file, by kind."""


def cases(kind: str, most: int | None = None) -> list[Case]:
    """Return the files of a kind, or some of them, drawn by a fixed seed."""
    whole = [Case(kind, name, make) for name, make in KINDS[kind]()]
    return whole if most is None else list(islice(random.Random(22).sample(whole, len(whole)), most))
