"""Fuzzing of the structure of files: recordings that are valid MCAP with right checksums, and lie about themselves.

    python tests/fuzz/hostile_files.py --quick    # a sample of files and commands: within a minute
    python tests/fuzz/hostile_files.py -o results # all files, all commands

`Model` takes a recording apart, `assemble` writes it again with right lengths, checksums and index. In between, a
mutation puts lies into it: counts that are huge, negative or of another kind, deep nesting, missing and repeated fields
and records, numbers of thousands of digits, cut texts, chunks that expand or do not unpack. Every command that opens a
recording then runs in a process of its own. It must end in bounded time and memory with an exit code that it documents,
without a traceback, and say in plain lines what is wrong. Unlike damage (`make evidence ARGS=recovery`), no checksum
reveals such a file. The seed determines the files.
"""

import json
import math
import os
import random
import re
import resource
import shutil
import signal
import struct
import sys
import time
import traceback
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from copy import deepcopy
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import lz4.frame
import msgpack
import numpy as np
import typer
import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from netboard.base.tick import TICK
from netboard.benchmarks.harness.results import Folder, Part
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import EventRecord, LogBatch, TickRecord
from netboard.recording.files.provenance import CONFIG_NAME, MetadataName, config_sha256
from netboard.recording.files.reader import Recording
from netboard.recording.format.batches import ATTEMPTS_NAME, PLACES, PLACES_NAME, pack
from netboard.recording.format.channels import IDS
from netboard.recording.format.chunks import MAGIC
from netboard.recording.format.predictions import CONSTANTS
from netboard.recording.recovery import spill

SEED_FILE = Path(__file__).parent.parent / "data" / "recordings" / "format-4.mcap"
SEED = 22
CASES, QUICK_CASES = 400, 30
"""Random files in addition to the named ones, in full and short form [1]."""

QUICK_COMMANDS = 2
"""Commands for each file in the short form, taken in turn [1]."""

MAX_SECONDS, MAX_MB = 60.0, 700.0
"""Longest time on the processor of a command [s], and largest memory beyond that of one that does nothing [MB]."""

ANALYSED = 20
"""One file in so many is analysed, which takes ten times as long as anything else [1]."""

PATIENCE = 10
"""How many times as long a command may take by the clock, on a machine that has other work [1]."""

INTEGERS = (
    0,
    1,
    -1,
    2,
    255,
    2**16,
    2**31 - 1,
    2**31,
    2**32 - 1,
    10**9,
    10**12,
    2**53,
    2**62,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
TEXTS = (
    *(
        "",
        "0",
        "-1",
        "9" * 6000,
        "1e999",
        "nan",
        "None",
        "true",
        "\0",
        "\n\n",
        "\x1b[2J\x1b[31m",
        "=1+1",
        "x" * 100_000,
    ),
    *("٣", "²", "../../../tmp/x", "/dev/zero", "\u202e", "ä\ud7ff", "{", "[" * 5000, "%s%n", "[bold]"),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, *INTEGERS, *(-number for number in INTEGERS[5:])),
    *(0.5, -0.0, math.nan, math.inf, -math.inf, 1e308, 5e-324),
    *TEXTS,
    *([], {}, [[]], [None] * 1000, {"": ""}, {"a": {"b": {}}}, ["x"] * 3, [0] * 100_000),
)


def nested(depth: int, inner: str = "") -> str:
    """Return JSON lists within lists."""
    return "[" * depth + inner + "]" * depth


# --- a recording, taken apart and put together -----------------------------------------------------------------------


@dataclass
class Model:
    """The content of a recording."""

    profile: str = ""
    library: str = ""
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)
    schemas: list[list[Any]] = field(default_factory=list)  # id, name, encoding, data
    channels: list[list[Any]] = field(default_factory=list)  # id, schema id, topic, encoding
    chunks: list[list[list[Any]]] = field(default_factory=list)  # messages: channel, sequence, log, publish time, data
    places: list[list[int]] = field(default_factory=list)  # number of the chunk, first and last tick, count
    packed: dict[int, tuple[str, bytes, int]] = field(default_factory=dict)  # compression, data, size of some chunks
    repeat: dict[str, int] = field(default_factory=dict)  # how often records of a kind are written, if not once
    config_is_right: bool = True  # whether its checksum is made to fit

    @classmethod
    def read(cls, path: Path) -> "Model":
        """Take a recording apart."""
        model, offsets, position = cls(), {}, len(MAGIC)
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                match record:
                    case Header():
                        model.profile, model.library = record.profile, record.library
                    case Metadata():
                        model.metadata.append((record.name, dict(record.metadata)))
                    case Attachment():
                        model.attachments[record.name] = record.data
                    case Schema() if record.id not in [one[0] for one in model.schemas]:
                        model.schemas.append([record.id, record.name, record.encoding, record.data])
                    case Channel() if record.id not in [one[0] for one in model.channels]:
                        model.channels.append([record.id, record.schema_id, record.topic, record.message_encoding])
                    case Chunk():
                        model.chunks.append(
                            [
                                [one.channel_id, one.sequence, one.log_time, one.publish_time, one.data]
                                for one in breakup_chunk(record)
                                if isinstance(one, Message)
                            ]
                        )
                        inside = breakup_chunk(record)
                        for one in inside:
                            if isinstance(one, Schema) and one.id not in [s[0] for s in model.schemas]:
                                model.schemas.append([one.id, one.name, one.encoding, one.data])
                            if isinstance(one, Channel) and one.id not in [c[0] for c in model.channels]:
                                model.channels.append([one.id, one.schema_id, one.topic, one.message_encoding])
        data = path.read_bytes()
        while position < len(data) - len(MAGIC):
            opcode, length = struct.unpack_from("<BQ", data, position)
            if opcode == Opcode.CHUNK:
                offsets[position] = len(offsets)
            position += 9 + length
        rows = np.frombuffer(model.attachments.pop(PLACES_NAME), PLACES)
        model.places = [[offsets[row[0]], *row[1:]] for row in rows.tolist()]
        return model

    def values(self, name: str) -> dict[str, str]:
        """Return the values of a metadata record."""
        return next(values for found, values in self.metadata if found == name)


Lie = Callable[[str, Any], Any]


def honest(name: str, value: Any) -> Any:
    """Return every field as it is."""
    return value


class _Out:
    """A file in memory, whose fields go through a lie."""

    def __init__(self, lie: Lie) -> None:
        self.data = bytearray(MAGIC)
        self.lie = lie

    def number(self, name: str, value: int, size: int) -> bytes:
        return (int(self.lie(name, value)) % 2 ** (8 * size)).to_bytes(size, "little")

    def text(self, name: str, value: str, size: int = 4) -> bytes:
        whole = self.lie(name, value)
        data = whole if isinstance(whole, bytes) else str(whole).encode("utf-8", "surrogatepass")
        return self.number(f"{name} length", len(data), size) + data

    def pairs(self, name: str, values: dict[str, str]) -> bytes:
        data = b"".join(
            self.text(f"{name} key", key) + self.text(f"{name} {key}", value) for key, value in values.items()
        )
        return self.number(f"{name} length", len(data), 4) + data

    def record(self, name: str, opcode: int, body: bytes) -> int:
        """Write a record and return its offset."""
        at = len(self.data)
        self.data += bytes([int(self.lie(f"{name} opcode", opcode)) % 256])
        self.data += self.number(f"{name} record length", len(body), 8) + body
        return at


def _chunk_body(out: _Out, model: Model, number: int) -> tuple[bytes, list[Any]]:
    """Return a chunk record, and what the index says of it."""
    name, inside, times = f"chunk {number % 3}", bytearray(), [0]
    for channel, sequence, log, publish, data in model.chunks[number]:
        head = out.number("message channel", channel, 2) + out.number("message sequence", sequence, 4)
        head += out.number("message log time", log, 8) + out.number("message publish time", publish, 8)
        inside += b"\x05" + out.number("message record length", len(head) + len(data), 8) + head + data
        times.append(log)
    data = bytes(inside)
    compression, packed, size = model.packed.get(number, ("zstd", zstandard.compress(data), len(data)))
    start, stop = min(times[1:], default=0), max(times)
    body = out.number(f"{name} start", start, 8) + out.number(f"{name} end", stop, 8)
    body += out.number(f"{name} size", size, 8)
    body += out.number(f"{name} crc", zlib.crc32(data) if number not in model.packed else 0, 4)
    body += out.text(f"{name} compression", compression) + out.text(f"{name} data", packed, 8)
    return body, [start, stop, compression, len(packed), size]


def assemble(model: Model, lie: Lie = honest) -> bytes:
    """Write a recording, with right lengths and checksums wherever there is no lie."""
    out = _Out(lie)
    if model.config_is_right and CONFIG_NAME in model.attachments:
        for name, values in model.metadata:
            if name == MetadataName.OPENED:
                values["config_sha256"] = config_sha256(model.attachments[CONFIG_NAME])
    out.record("header", Opcode.HEADER, out.text("profile", model.profile) + out.text("library", model.library))
    index: list[tuple[int, bytes]] = []
    head, *tail = model.metadata or [("", {})]
    _metadata(out, index, [head] if model.metadata else [])
    _attachments(out, model, index, {CONFIG_NAME: model.attachments.get(CONFIG_NAME)})
    chunks = []
    for number in range(len(model.chunks)):
        body, about = _chunk_body(out, model, number)
        chunks.append(out.record("chunk", Opcode.CHUNK, body))
        index += [(Opcode.CHUNK_INDEX, _chunk_index(out, chunks[-1], len(body) + 9, about))] * model.repeat.get(
            "chunk", 1
        )
    rows = [
        (chunks[row[0] % len(chunks)] if 0 <= row[0] < 10**6 and chunks else row[0], *row[1:]) for row in model.places
    ]
    places = b"".join(struct.pack("<4q", *(max(-(2**63), min(2**63 - 1, value)) for value in row)) for row in rows)
    others = {name: data for name, data in model.attachments.items() if name != CONFIG_NAME}
    _attachments(out, model, index, others | {PLACES_NAME: model.attachments.get(PLACES_NAME, places)})
    _metadata(out, index, tail)
    out.record("data end", Opcode.DATA_END, out.number("data crc", zlib.crc32(out.data), 4))
    _summary(out, model, index)
    out.data += MAGIC
    return bytes(out.data)


def _metadata(out: _Out, index: list[tuple[int, bytes]], records: Sequence[tuple[str, dict[str, str]]]) -> None:
    for name, values in records:
        body = out.text("metadata name", name) + out.pairs("metadata", values)
        at = out.record("metadata", Opcode.METADATA, body)
        entry = out.number("metadata index offset", at, 8) + out.number("metadata index size", len(body) + 9, 8)
        index.append((Opcode.METADATA_INDEX, entry + out.text("metadata index name", name)))


def _attachments(out: _Out, model: Model, index: list[tuple[int, bytes]], files: dict[str, bytes | None]) -> None:
    for name, data in ((name, data) for name, data in files.items() if data is not None):
        body = out.number("attachment log time", 1, 8) + out.number("attachment time", 1, 8)
        body += out.text("attachment name", name) + out.text("attachment type", "application/octet-stream")
        body += out.text("attachment data", data, 8)
        body += out.number("attachment crc", zlib.crc32(body), 4)
        at = out.record("attachment", Opcode.ATTACHMENT, body)
        entry = out.number("attachment index offset", at, 8) + out.number("attachment index size", len(body) + 9, 8)
        entry += struct.pack("<QQ", 1, 1) + out.number("attachment index data size", len(data), 8)
        entry += out.text("attachment index name", name) + out.text("attachment index type", "")
        index += [(Opcode.ATTACHMENT_INDEX, entry)] * model.repeat.get("attachment", 1)


def _chunk_index(out: _Out, at: int, length: int, about: list[Any]) -> bytes:
    start, stop, compression, packed, size = about
    entry = out.number("chunk index start", start, 8) + out.number("chunk index end", stop, 8)
    entry += out.number("chunk index offset", at, 8) + out.number("chunk index record size", length, 8)
    entry += out.number("chunk index messages length", 0, 4) + struct.pack("<Q", 0)
    entry += out.text("chunk index compression", compression)
    return entry + out.number("chunk index packed", packed, 8) + out.number("chunk index size", size, 8)


def _summary(out: _Out, model: Model, index: list[tuple[int, bytes]]) -> None:
    start = len(out.data)
    counts = [0] * 2**8
    for message in (message for chunk in model.chunks for message in chunk):
        counts[message[0] % 2**8] += 1
    for number, name, encoding, data in model.schemas * model.repeat.get("schema", 1):
        body = (
            out.number("schema id", number, 2) + out.text("schema name", name) + out.text("schema encoding", encoding)
        )
        out.record("schema", Opcode.SCHEMA, body + out.text("schema data", data))
    for number, schema, topic, encoding in model.channels * model.repeat.get("channel", 1):
        body = out.number("channel id", number, 2) + out.number("channel schema", schema, 2)
        body += out.text("channel topic", topic) + out.text("channel encoding", encoding) + out.pairs("channel", {})
        out.record("channel", Opcode.CHANNEL, body)
    pairs = b"".join(
        out.number("statistics channel", number, 2) + out.number("statistics count", count, 8)
        for number, count in enumerate(counts)
        if count
    )
    body = out.number("statistics messages", sum(counts), 8) + struct.pack("<HIII", 7, 7, 3, 3)
    body += out.number("statistics chunks", len(model.chunks), 4) + struct.pack("<QQ", 0, 0)
    out.record("statistics", Opcode.STATISTICS, body + out.number("statistics length", len(pairs), 4) + pairs)
    for opcode, entry in index:
        out.record("index", opcode, entry)
    footer = out.number("summary start", start, 8) + out.number("summary offset start", 0, 8)
    head = bytes([Opcode.FOOTER]) + struct.pack("<Q", 20)
    crc = zlib.crc32(bytes(out.data[start:]) + head + footer)
    out.data += head + footer + out.number("summary crc", crc, 4)


# --- lies ------------------------------------------------------------------------------------------------------------

Mutation = Callable[[Model, random.Random], bytes]


def twist(value: Any, rng: random.Random) -> Any:
    """Return a value of JSON or MessagePack with a lie somewhere in it."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(list(value))
        changed = dict(value)
        match rng.randrange(8):
            case 0:
                del changed[key]
            case 1:
                changed[rng.choice(("", "x" * 300, "np", "before", key + " "))] = changed.pop(key)
            case _:
                changed[key] = twist(value[key], rng)
        return changed
    if isinstance(value, list) and value and rng.random() < 0.85:
        place = rng.randrange(len(value))
        match rng.randrange(8):
            case 0:
                return value[:place] + value[place + 1 :]
            case 1:
                return value + value[place : place + 1] * rng.choice((1, 3, 3000))
            case _:
                return [*value[:place], twist(value[place], rng), *value[place + 1 :]]
    if isinstance(value, bytes):
        return rng.choice((b"", value[:-1], value + value, b"\xff" * 40, value[: len(value) // 2], *VALUES[:20]))
    if isinstance(value, str) and rng.random() < 0.3:
        return rng.choice((value[: len(value) // 2], value * 50, value + "\n", value.upper()))
    return deepcopy(rng.choice(VALUES))


def twist_text(text: str, rng: random.Random) -> bytes:
    """Return a JSON text that is cut, nested or has something else that no value has."""
    number = re.search(r"-?\d+", text)
    again = re.sub(r'"(\w+)": ', lambda key: f"{key[0]}1, {key[0]}", text, count=1)
    with_digits = text if number is None else text[: number.start()] + "9" * 6000 + text[number.end() :]
    choices = (
        text[: rng.randrange(len(text))],
        nested(rng.choice((600, 3000, 200_000)), text),
        with_digits,
        again,
        text.replace(": ", ": [" * 1, 1),
        '{"columns": ' + nested(100_000) + "}",
        "",
        "\ufeff" + text,
        text.replace('"', "'"),
    )
    return rng.choice(choices).encode()


def in_json(data: bytes, rng: random.Random) -> bytes:
    """Return a JSON text with a lie in it."""
    text = data.decode()
    if rng.random() < 0.3:
        return twist_text(text, rng)
    return json.dumps(twist(json.loads(text), rng)).encode()


def lie_in_field(model: Model, rng: random.Random) -> bytes:
    """Put a lie into one to three fields of the records of MCAP."""
    fields: list[str] = []

    def note(name: str, value: Any) -> Any:
        fields.append(name)
        return value

    assemble(model, note)
    chosen = {rng.choice(sorted(set(fields))): rng.randrange(8) for _ in range(rng.choice((1, 1, 2, 3)))}

    def lie(name: str, value: Any) -> Any:
        if name not in chosen or (chosen[name] and rng.random() < 0.5):
            return value
        if isinstance(value, int):
            return rng.choice((*INTEGERS, value + 1, value - 1, value * 2, -value, value // 2))
        return rng.choice((*TEXTS, value[: len(value) // 2], value + value))

    return assemble(model, lie)


def lie_in_schema(model: Model, rng: random.Random) -> bytes:
    """Put a lie into a schema, mostly that of the ticks."""
    schema = model.schemas[0] if rng.random() < 0.8 else rng.choice(model.schemas)
    if rng.random() < 0.5:
        described = json.loads(schema[3])
        column = rng.choice(described["columns"]) if "columns" in described else described
        column[rng.choice(("name", "type", "differences"))] = rng.choice(
            (*VALUES, 9, 2**40, "O", "V1000000000", "(1000,1000)<f8", "<i8,<i8", "M8[ns]", "tick", "<f8")
        )
        schema[3] = json.dumps(described).encode()
    else:
        schema[3] = in_json(schema[3], rng)
    return assemble(model)


def lie_in_attempts(model: Model, rng: random.Random) -> bytes:
    """Put a lie into the list of attempts."""
    listed = json.loads(model.attachments[ATTEMPTS_NAME])
    if rng.random() < 0.5:
        attempt = rng.choice(listed)
        attempt[rng.choice(list(attempt))] = rng.choice(VALUES)
        listed *= rng.choice((1, 1, 1000))
        model.attachments[ATTEMPTS_NAME] = json.dumps(listed).encode()
    else:
        model.attachments[ATTEMPTS_NAME] = in_json(model.attachments[ATTEMPTS_NAME], rng)
    return assemble(model)


def lie_in_metadata(model: Model, rng: random.Random) -> bytes:
    """Put a lie into the metadata: values, keys, records that are missing or repeated."""
    name, values = rng.choice(model.metadata)
    match rng.randrange(6):
        case 0:
            model.metadata = [one for one in model.metadata if one[0] != name]
        case 1:
            model.metadata += [(name, {key: rng.choice(TEXTS) for key in values})] * rng.choice((1, 2000))
        case 2:
            values.update({f"key {k}": "x" for k in range(20_000)})
        case _:
            for key in rng.sample(list(values), min(len(values), rng.choice((1, 1, 3)))):
                values.pop(key)
                if rng.random() < 0.75:
                    values[key] = rng.choice(TEXTS)
    return assemble(model)


def lie_in_places(model: Model, rng: random.Random) -> bytes:
    """Put a lie into the list of places."""
    match rng.randrange(5):
        case 0:
            model.places = [rng.choice(model.places)] * rng.choice((2, 1000))
        case 1:
            model.places = model.places[: rng.randrange(len(model.places))]
        case 2:
            model.attachments[PLACES_NAME] = rng.randbytes(rng.choice((0, 7, 32, 3200)))
        case _:
            row = rng.choice(model.places)
            row[rng.randrange(4)] = rng.choice((*INTEGERS, *(-one for one in INTEGERS), row[3] * 10**6, row[2]))
    return assemble(model)


def lie_in_message(model: Model, rng: random.Random) -> bytes:
    """Put a lie into some messages of a channel."""
    channel = rng.choice([*IDS.values(), IDS["/ticks"], IDS["/event"]])
    found = [message for chunk in model.chunks for message in chunk if message[0] == channel]
    for message in rng.sample(found, min(len(found), rng.choice((1, 3)))):
        if rng.random() < 0.15:
            message[4] = rng.choice(
                (b"", b"\xc1", b"\xdd\xff\xff\xff\xff", b"\x91" * 2000, b"\xdc\xff\xff" * 1000, message[4][:-3])
            )
            continue
        try:
            message[4] = msgpack.packb(twist(msgpack.unpackb(message[4]), rng))
        except (OverflowError, ValueError):
            message[4] = b"\xc0"
    return assemble(model)


def lie_in_event(model: Model, rng: random.Random) -> bytes:
    """Put a lie into the details of events whose details are read."""
    last = model.chunks[-1]
    details: dict[str, dict[str, str]] = {
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
    topic = rng.choice(("/event", "/event", "/logger"))
    for number in range(rng.choice((1, 2))):
        name = rng.choice(list(details))
        own = {key: rng.choice(TEXTS) if rng.random() < 0.5 else value for key, value in details[name].items()}
        if rng.random() < 0.3:
            own.pop(rng.choice(list(own)))
        event = {"seq": 90 + number, "tick": rng.choice((500, -1, *INTEGERS[:-2])), "time_ns": 10**12, "name": name}
        last.append([IDS[topic], 90 + number, last[-1][2], last[-1][3], msgpack.packb(event | {"details": own})])
    return assemble(model)


def lie_in_ticks(model: Model, rng: random.Random) -> bytes:
    """Put impossible values into a column of a batch, encoded as it should be."""
    column = rng.choice(TICK.names)
    batches = [message for chunk in model.chunks for message in chunk if message[0] == IDS["/ticks"]]
    with TemporaryDirectory() as scratch:
        place = Path(scratch) / "a.mcap"
        place.write_bytes(assemble(model))
        with Recording(place) as recording:
            rows = recording.ticks(as_sent=True)
    number = rng.randrange(len(batches))
    sizes = [msgpack.unpackb(message[4])["count"] for message in batches]
    first = sum(sizes[:number])
    mine = rows[first : first + sizes[number]].copy()
    values: tuple[Any, ...] = (
        (*(one for one in INTEGERS if one < 2**63), -1, -(2**63))
        if TICK[column].kind == "i"
        else (math.nan, math.inf, -math.inf, 1e308, -1e9, 5e-324)
    )
    where = slice(None) if rng.random() < 0.5 else rng.randrange(len(mine))
    mine[column][where] = rng.choice(values)
    message = msgpack.unpackb(batches[number][4])
    message["columns"] = pack(mine, dict(zip(CONSTANTS, message["constants"], strict=True)))
    batches[number][4] = msgpack.packb(message)
    return assemble(model)


def lie_in_config(model: Model, rng: random.Random) -> bytes:
    """Put a lie into the configuration, whose checksum fits."""
    lines = model.attachments[CONFIG_NAME].decode().splitlines()
    place = rng.choice([number for number, line in enumerate(lines) if " = " in line])
    key, _, value = lines[place].partition(" = ")
    words = (
        "9" * 6000,
        "1e308",
        "nan",
        "inf",
        "-1",
        "0",
        "true",
        '"x"',
        nested(2000),
        "[]",
        "{}",
        "10000",
        "1e-300",
        "[1, 2, 3]",
    )
    match rng.randrange(6):
        case 0:
            del lines[place]
        case 1:
            lines[place] = f"{key} = {value}\n{key} = {value}"
        case 2:
            lines[place] = f"{'a.' * 5000}b = 1"
        case _:
            lines[place] = f"{key} = {rng.choice(words)}"
    text = "\n".join(lines).encode()
    model.attachments[CONFIG_NAME] = rng.choice((text, text, text, text + b"\xff\xfe", text[: len(text) // 2]))
    model.config_is_right = rng.random() < 0.9
    return assemble(model)


def lie_in_chunk(model: Model, rng: random.Random) -> bytes:
    """Write chunks that expand, do not unpack, or are not what the index says."""
    number = rng.randrange(len(model.chunks))
    zeros = bytes(rng.choice((2**20, 2**27)))
    packed = zstandard.compress(zeros)
    message = b"\x05" + struct.pack("<QHIQQ", 22 + 2**20, 1, 0, 0, 0) + bytes(2**20)
    model.packed[number] = rng.choice(
        (
            ("zstd", packed, len(zeros)),
            ("zstd", packed, 2**50),
            ("zstd", packed[:-5], len(zeros)),
            ("lz4", b"\x04\x22\x4d\x18 this is not lz4", 1000),
            ("lz4", lz4.frame.compress(zeros), len(zeros)),
            ("lz4", lz4.frame.compress(zeros), 10),
            ("lz4", b"", 0),
            ("zstd", b"", 0),
            ("", b"\x05\xff\xff\xff\xff\xff\xff\xff\x7f", 9),
            ("", b"\x05" + struct.pack("<Q", 3) + b"abc", 12),
            ("zstd", zstandard.compress(message * 30), len(message) * 30),
            ("brotli", packed, len(zeros)),
            ("zstd\n\x1b[31m", packed, len(zeros)),
        )
    )
    return assemble(model)


def lie_in_records(model: Model, rng: random.Random) -> bytes:
    """Leave out or repeat whole records: channels, schemas, chunks, attachments."""
    match rng.randrange(6):
        case 0:
            model.channels = [one for one in model.channels if rng.random() < 0.6]
        case 1:
            model.schemas = [one for one in model.schemas if rng.random() < 0.6]
        case 2:
            model.repeat = {rng.choice(("chunk", "attachment", "schema", "channel")): rng.choice((0, 2, 3000))}
        case 3:
            for name in rng.sample(list(model.attachments), 1):
                del model.attachments[name]
        case 4:
            model.chunks = rng.sample(model.chunks, rng.randrange(len(model.chunks)))
        case _:
            model.channels[rng.randrange(len(model.channels))][rng.randrange(4)] = rng.choice((0, 1, 2, 65535))
    return assemble(model)


MUTATIONS: dict[str, Mutation] = {
    "fields of the records": lie_in_field,
    "schema of the ticks": lie_in_schema,
    "list of attempts": lie_in_attempts,
    "metadata": lie_in_metadata,
    "list of places": lie_in_places,
    "messages": lie_in_message,
    "details of events": lie_in_event,
    "values of ticks": lie_in_ticks,
    "configuration": lie_in_config,
    "chunks": lie_in_chunk,
    "missing, repeated records": lie_in_records,
}


def _schema_with(**column: Any) -> Mutation:
    def mutate(model: Model, rng: random.Random) -> bytes:
        described = json.loads(model.schemas[0][3])
        described["columns"][3].update(column)
        model.schemas[0][3] = json.dumps(described).encode()
        return assemble(model)

    return mutate


def _attached(name: str, data: bytes) -> Mutation:
    def mutate(model: Model, rng: random.Random) -> bytes:
        model.attachments[name] = data
        return assemble(model)

    return mutate


def _counts(count: int) -> Mutation:
    def mutate(model: Model, rng: random.Random) -> bytes:
        model.places[0][3] = count
        return assemble(model)

    return mutate


def _nested_schema(model: Model, rng: random.Random) -> bytes:
    model.schemas[0][3] = b'{"columns": ' + nested(100_000).encode() + b"}"
    return assemble(model)


def _long_number(model: Model, rng: random.Random) -> bytes:
    model.values(MetadataName.OPENED)["opened_log_ns"] = "1" * 6000
    return assemble(model)


def _bad_lz4(model: Model, rng: random.Random) -> bytes:
    model.packed[0] = ("lz4", b"this is not lz4 at all" * 100, 300_000)
    return assemble(model)


NAMED: dict[str, Mutation] = {
    "differences: 1000000000": _schema_with(differences=10**9),
    "nested schema": _nested_schema,
    "nested list of attempts": _attached(ATTEMPTS_NAME, nested(100_000).encode()),
    "number of 6000 digits": _long_number,
    "count of 2**62 ticks": _counts(2**62),
    "negative count of ticks": _counts(-5),
    "lz4 that does not unpack": _bad_lz4,
}
"""Files that have made commands hang or end in a traceback."""


def make_file(place: Path, mutate: Mutation, rng: random.Random) -> Path:
    """Write a hostile recording into a folder of its own, with its journal beside it."""
    path = place / "S01_D01_20260921T143320Z_3f2a9c1e.mcap"
    path.write_bytes(mutate(Model.read(SEED_FILE), rng))
    return path


# --- files other than recordings -------------------------------------------------------------------------------------


def make_spill(place: Path, rng: random.Random) -> Path:
    """Write a server's spill whose blocks are whole, and whose messages lie."""
    with Recording(SEED_FILE) as recording:
        text, rows = recording.config_text, recording.ticks(0, 40)
    number = rng.choice((0, 5, 2**62, -(2**63)))
    opened = {"utc_ns": rng.choice(("1790000000000000000", *TEXTS))[:20_000]}
    messages: list[Any] = [
        Welcome(
            "3f2a9c1e00000000", 1, rng.choice((7, -(2**63), 2**63 - 1)), rng.choice((text, text, "x = " + nested(900)))
        ),
        EventRecord(0, 0, rng.choice((0, 2**63 - 1, -(2**63))), spill.OPENED, opened if rng.random() < 0.8 else {}),
    ]
    rows = rows.copy()
    rows["time_ns"][rng.randrange(40)] = rng.choice((0, -(2**63), 2**63 - 1))
    frames = [encode(TickRecord(row.tobytes())) for row in rows]
    frames.insert(7, encode(EventRecord(1, 3, 5, "block_began", {"config": rng.choice((text, nested(900), ""))})))
    frames.insert(9, encode(TickRecord(b"short")))
    messages += [LogBatch(0, 0, tuple(frames)), LogBatch(number, 0, tuple(frames))]
    if rng.random() < 0.3:
        rng.shuffle(messages)
    path = place / "S01_D01_3f2a9c1e.spill"
    path.write_bytes(spill.MAGIC + b"".join(spill.block_of(encode(one)) for one in messages))
    return path


def make_journal(place: Path, rng: random.Random) -> Path:
    """Write a journal of lies beside a sound recording."""
    path = place / "S01_D01_20260921T143320Z_3f2a9c1e.mcap"
    shutil.copyfile(SEED_FILE, path)
    header = {
        "entry": "header",
        "format": 1,
        "session": 1,
        "dyad": "D01",
        "name": "S01",
        "study": "paper",
        "seed": 1,
        "study_digest": "x",
        "plan_digest": "x",
        "config": "",
        "config_digest": "",
        "netboard": "0.1.0",
        "pilot": False,
    }
    lines = [json.dumps(twist(header, rng) if rng.random() < 0.6 else header)]
    lines += [
        json.dumps(twist({"entry": "attempt_ended", "trial": 1, "attempt": 1, "block": 1}, rng)) for _ in range(3)
    ]
    lines.insert(
        rng.randrange(4), rng.choice((nested(100_000), '{"entry": ' + "9" * 6000 + "}", "\0", '{"entry": []}', "{}"))
    )
    (place / "D01_S01.journal.jsonl").write_bytes("\n".join(lines).encode() + b"\n")
    return path


def make_cut(place: Path, rng: random.Random) -> Path:
    """Write an unfinished recording of lies: many chunks and records that contain each other."""
    data = assemble(Model.read(SEED_FILE))
    signature = (
        b"\x06" + struct.pack("<QQQQI", 60, 0, 0, 1000, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", 15)
    )
    name = struct.pack("<I", 8) + b"netboard"
    record = b"\x0c" + struct.pack("<Q", 2**20) + name
    whole = b"\x0c" + struct.pack("<Q", len(name) + 4) + name + struct.pack("<I", 0)
    garbage = rng.choice((signature, record, whole + b"\xff", signature + record)) * 4000
    at = rng.randrange(len(MAGIC), len(data))
    path = place / "S01_D01_20260921T143320Z_3f2a9c1e.mcap.part"
    path.write_bytes(data[:at] + garbage + (data[at:] if rng.random() < 0.5 else b""))
    return path


OTHERS: dict[str, Callable[[Path, random.Random], Path]] = {
    "spill": make_spill,
    "journal": make_journal,
    "unfinished file": make_cut,
}


# --- commands --------------------------------------------------------------------------------------------------------

COMMANDS: dict[str, Callable[[Path, Path], list[str]]] = {
    "check": lambda file, out: ["check", str(file)],
    "check --verify": lambda file, out: ["check", str(file), "--verify"],
    "info": lambda file, out: ["info", str(file)],
    "replay --verify": lambda file, out: ["replay", str(file), "--verify"],
    "export csv": lambda file, out: ["export", str(file), "--to", "csv", "-o", str(out)],
    "export parquet": lambda file, out: ["export", str(file), "--to", "parquet", "-o", str(out)],
    "export mat": lambda file, out: ["export", str(file), "--to", "mat", "-o", str(out)],
    "export bids": lambda file, out: ["export", str(file), "--to", "bids", "-o", str(out)],
    "export nwb": lambda file, out: ["export", str(file), "--to", "nwb", "-o", str(out)],
    "export xdf": lambda file, out: ["export", str(file), "--to", "xdf", "-o", str(out)],
    "analyse": lambda file, out: ["analyse", str(file), "-o", str(out), "--workers", "1"],
    "recover": lambda file, out: ["recover", str(file), "-o", str(out.with_suffix(".mcap"))],
    "trace": lambda file, out: ["trace", str(file)],
    "whatif": lambda file, out: ["whatif", str(file), "--set", "physics.k_h=400"],
    "sessions": lambda file, out: ["sessions", str(file.parent)],
    "sessions --check": lambda file, out: ["sessions", str(file.parent), "--check"],
}
"""Commands that open a recording, with the file and a new output."""

DOCUMENTED = {"check": (0, 1, 3), "check --verify": (0, 1, 3), "replay --verify": (0, 1, 2)}
"""Exit codes of commands that print a result, and may end with 1 then; of others 0 clean, 1 a fault, 2 wrong input."""

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


@dataclass(frozen=True)
class Result:
    """How a command ended for a file."""

    kind: str
    command: str
    code: int
    seconds: float
    memory_mb: float
    stdout: str
    stderr: str

    @property
    def fault(self) -> str:
        """What the command did wrong; empty if nothing."""
        if self.code not in DOCUMENTED.get(self.command, (0, 1, 2)):
            return f"exit code {self.code} after {self.seconds:.0f} s"
        if "Traceback" in self.stdout + self.stderr:
            return "a traceback"
        lines = self.stderr.rstrip("\n").splitlines()
        if self.code and not lines and self.command not in DOCUMENTED:
            return "no word on stderr"
        if len(lines) > 20 or max(map(len, lines), default=0) > 2000:
            return f"{len(lines)} lines of up to {max(map(len, lines))} characters on stderr"
        if _CONTROL.search(self.stderr) or "\x1b[2J" in self.stdout:
            return "control characters on the terminal"
        return "" if self.memory_mb < MAX_MB else f"{self.memory_mb:.0f} MB"

    @property
    def last_line(self) -> str:
        """Return the last line that the command printed."""
        return ((self.stderr or self.stdout).strip().splitlines() or [""])[-1]


def run_command(kind: str, command: str, file: Path, out: Path) -> Result:
    """Run a command in a process of its own."""
    names = [out.with_suffix(ending) for ending in (".stdout", ".stderr")]
    child = os.fork()
    if not child:
        _become(COMMANDS[command](file, out), *names)
    code, seconds, used = _wait(child)
    texts = [name.read_text(encoding="utf-8", errors="replace") for name in names]
    return Result(kind, command, code, seconds, used, *texts)


def _become(argv: list[str], stdout: Path, stderr: Path) -> None:
    """Run a command in this new process and end it."""
    from netboard.services.cli import app

    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_CPU, (round(MAX_SECONDS), round(MAX_SECONDS)))
    code = 99
    for name, number in ((stdout, 1), (stderr, 2)):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))
    try:
        app(argv)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:  # noqa: BLE001 - a traceback is what this looks for
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _wait(child: int) -> tuple[int, float, float]:
    """Wait for a process, and kill it if it waits for ever.

    Return its exit code, its time on the processor [s], and its largest memory [MB].
    """
    began = time.perf_counter()
    while True:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3 - _BASELINE[0]
        if time.perf_counter() - began > MAX_SECONDS * PATIENCE:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.005)


_BASELINE = [0.0]


def warm_up(scratch: Path) -> None:
    """Run every command on the file without lies in this process, which then has its modules and kernels loaded."""
    from netboard.services.cli import app

    place = scratch / "sound"
    place.mkdir()
    file = make_file(place, lambda model, rng: assemble(model), random.Random(0))
    for command, argv in COMMANDS.items():
        said = StringIO()
        with redirect_stdout(said), redirect_stderr(said):
            try:
                app(argv(file, place / f"out {command}"))
            except SystemExit as end:
                if command != "trace" and end.code not in (None, *DOCUMENTED.get(command, (0,))):  # it has no agent
                    raise SystemExit(f"{command}: exit code {end.code} for a sound file: {said.getvalue()}") from None
    child = os.fork()
    if not child:
        os._exit(0)
    _BASELINE[0] = _wait(child)[2]


def cases(count: int) -> Iterator[tuple[str, Callable[[Path], Path], bool]]:
    """Yield the kind and the maker of each file, and whether it gets every command also in the short form."""
    for number, (name, mutate) in enumerate(NAMED.items()):
        yield name, lambda place, m=mutate, n=number: make_file(place, m, random.Random(n)), True
    kinds = [*MUTATIONS, *OTHERS]
    for number in range(count):
        kind, rng = kinds[number % len(kinds)], random.Random(SEED * 10**6 + number)
        if kind in OTHERS:
            yield kind, lambda place, k=kind, r=rng: OTHERS[k](place, r), False
        else:
            yield kind, lambda place, k=kind, r=rng: make_file(place, MUTATIONS[k], r), False


def results_of(count: int, tell: Tell, *, quick: bool, only: str = "") -> Iterator[Result]:
    """Run the commands on the files, and yield how each ended."""
    with TemporaryDirectory() as folder:
        scratch = Path(folder)
        warm_up(scratch)
        names, turn = list(COMMANDS), 0
        whole = list(cases(count))
        for number, (kind, make, _) in enumerate(whole):
            if only and only != f"{number}":
                continue
            chosen = [names[(turn + k * 5) % len(names)] for k in range(QUICK_COMMANDS)] if quick else names
            if number % ANALYSED:
                chosen = [name for name in chosen if name != "analyse"]
            turn += 1
            place = scratch / f"case-{number}"
            place.mkdir()
            file = make(place)
            for command in chosen:
                for left in [*place.glob("out*")]:
                    shutil.rmtree(left) if left.is_dir() else left.unlink()
                result = run_command(kind, command, file, place / "out")
                if result.fault and os.environ.get("KEEP"):
                    shutil.copytree(place, Path(os.environ["KEEP"]) / f"{number}-{command.replace(' ', '_')}")
                    print(f"{number} {kind} | {command} | {result.fault} | {result.last_line[:300]}", flush=True)  # noqa: T201
                yield result
            shutil.rmtree(place)
            tell(f"{kind}: {number + 1} of {len(whole)}", number / len(whole))


def study(count: int, only: str, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Run all files and tabulate how the commands ended."""
    found = list(results_of(count, tell, quick=quick, only=only))
    yield table(found, "files", "kind", lambda one: "a named file" if one.kind in NAMED else one.kind)
    part = table(found, "commands", "command", lambda one: one.command)
    faults = [f"{one.kind}, {one.command}: {one.fault}: {one.last_line:.200}" for one in found if one.fault]
    part.claim(
        f"every command ends within {MAX_SECONDS:g} s and {MAX_MB:g} MB, without a traceback, and says what is wrong",
        not faults,
        f"{len(faults)} faults, such as {faults[0]}" if faults else f"no fault in {len(found)} commands",
    )
    yield part


def table(found: Sequence[Result], name: str, heading: str, key: Callable[[Result], str]) -> Part:
    """Tabulate results by a property of theirs."""
    part = Part(
        name,
        "Recordings that lie about themselves, and how the commands that opened them ended",
        f"{heading} | runs [1] | clean or a result [1] | refused, and said so [1] | faults [1] | longest [s] | "
        "most memory [MB]",
    )
    for word in dict.fromkeys(map(key, found)):
        own = [one for one in found if key(one) == word]
        refused = sum(one.code in (1, 2) and not one.fault for one in own)
        faults = sum(bool(one.fault) for one in own)
        worst = (round(max(one.seconds for one in own), 2), round(max(one.memory_mb for one in own)))
        part.add(word, len(own), len(own) - refused - faults, refused, faults, *worst)
    return part


def main(
    output: Annotated[Path | None, typer.Option("--output", "-o", help="New folder of the results.")] = None,
    count: Annotated[int | None, typer.Option(help="Number of random files.")] = None,
    only: Annotated[str, typer.Option(help="Number of a file, to run it alone.")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="A sample of files and commands.")] = False,
) -> None:
    """Run the commands on hostile files; exit code 1 if one failed a requirement."""
    number = (QUICK_CASES if quick else CASES) if count is None else count

    def run_all(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
        yield from study(number, only, folder, tell, quick=quick)

    verdicts = run("hostile", run_all, Options(output, quick=quick), {"files": number + len(NAMED)}, bar=False)
    raise typer.Exit(0 if all(verdict.holds for verdict in verdicts) else 1)


if __name__ == "__main__":
    typer.run(main)
