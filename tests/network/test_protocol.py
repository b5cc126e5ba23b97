"""PROTOCOL.md is correct and sufficient: its tables are current, and a client written from its text packs the frames.

The packer below is such a client: it knows MessagePack, and knows the protocol from the tables only.
"""

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from wire_golden import EXAMPLES, FRAMES, twin
from wire_strategies import CLASSES

from netboard.network.keys import OPENS
from netboard.network.protocol import codec
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.messages import KINDS, PROTOCOL_VERSION
from netboard.network.transport.channels import CHANNELS


def documented_fields(text: str) -> dict[int, tuple[str, list[tuple[str, str]]]]:
    """Tables of PROTOCOL.md: kind -> (message, [(field, type), ...]), read from the text, not from the classes."""
    found: dict[int, tuple[str, list[tuple[str, str]]]] = {}
    for part in re.split(r"^### ", text, flags=re.MULTILINE):
        heading = re.match(r"(\w+): kind (\d+)", part)
        if heading:
            rows = re.findall(r"^\| \d+ \| `(\w+)` \| ([^|]+) \|", part, flags=re.MULTILINE)
            found[int(heading[2])] = (heading[1], rows)
    return found


TEXT = Path(codec.__file__).with_name("PROTOCOL.md").read_text(encoding="utf-8")
TABLES = documented_fields(TEXT)
JAVASCRIPT = Path(__file__).parents[1] / "integration" / "foreign" / "wire.mjs"
GOLDEN = sorted(FRAMES.glob("*.bin"))


def pack_head(short: int, most: int, wide: tuple[tuple[int, str], ...], count: int) -> bytes:
    """Header with a length: in the first byte, or after it in the narrowest width there is."""
    if count < most:
        return bytes([short | count])
    code, width = next((code, width) for code, width in wide if count < 256 ** struct.calcsize(width))
    return bytes([code]) + struct.pack(width, count)


def pack_array(items: list[bytes]) -> bytes:
    return pack_head(0x90, 16, ((0xDC, ">H"), (0xDD, ">I")), len(items)) + b"".join(items)


def pack_int(value: int) -> bytes:
    if -32 <= value < 128:
        return struct.pack(">b", value)
    widths = ((0xCC, ">B"), (0xCD, ">H"), (0xCE, ">I"), (0xCF, ">Q"))
    if value < 0:
        widths = ((0xD0, ">b"), (0xD1, ">h"), (0xD2, ">i"), (0xD3, ">q"))
    for code, width in widths:
        size = 8 * struct.calcsize(width)
        if (value < 2**size) if value >= 0 else (value >= -(2 ** (size - 1))):
            return bytes([code]) + struct.pack(width, value)
    raise AssertionError(value)


def pack(kind: str, value: Any) -> bytes:
    """A JSON value as the type that a table names."""
    if kind.endswith(" or nil"):
        return b"\xc0" if value is None else pack(kind.removesuffix(" or nil"), value)
    if kind.startswith("array of "):
        return pack_array([pack(kind.removeprefix("array of "), item) for item in value])
    if kind.startswith("["):
        return pack_array([pack(part, item) for part, item in zip(kind[1:-1].split(", "), value, strict=True)])
    return SCALARS[kind](value)


def pack_bool(value: bool) -> bytes:
    return b"\xc3" if value else b"\xc2"


def pack_float(value: float | str) -> bytes:
    return b"\xcb" + struct.pack(">d", float(value))


def pack_str(value: str) -> bytes:
    text = value.encode()
    return pack_head(0xA0, 32, ((0xD9, ">B"), (0xDA, ">H"), (0xDB, ">I")), len(text)) + text


def pack_bin(value: str) -> bytes:
    data = bytes.fromhex(value)
    return pack_head(0, 0, ((0xC4, ">B"), (0xC5, ">H"), (0xC6, ">I")), len(data)) + data


def pack_map(value: dict[str, str]) -> bytes:
    head = pack_head(0x80, 16, ((0xDE, ">H"), (0xDF, ">I")), len(value))
    return head + b"".join(pack_str(key) + pack_str(item) for key, item in value.items())


SCALARS: dict[str, Callable[[Any], bytes]] = {
    "int": pack_int,
    "float": pack_float,
    "bool": pack_bool,
    "str": pack_str,
    "bin": pack_bin,
    "map of str to str": pack_map,
}


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_client_written_from_the_text_packs_the_golden_frame(path: Path) -> None:
    golden = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    name, table = TABLES[golden["kind"]]
    assert name == golden["message"]
    assert [field for field, _ in table] == list(golden["fields"])
    parts = [pack_int(golden["kind"]), *(pack(kind, golden["fields"][field]) for field, kind in table)]
    assert pack_array(parts).hex() == path.read_bytes().hex()


@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_golden_frame_still_decodes_and_encodes_alike(path: Path) -> None:
    frame = path.read_bytes()
    message = decode(frame)
    assert encode(message) == frame
    assert twin(message) == json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    assert repr(message) == repr(decode(encode(EXAMPLES[path.stem])))


def test_every_message_class_has_a_golden_frame() -> None:
    assert {path.stem for path in GOLDEN} == set(EXAMPLES)
    assert {type(message) for message in EXAMPLES.values()} == set(CLASSES)


@pytest.mark.parametrize("channel", ["motion", "log", "control"])
def test_table_of_channels_lists_what_the_peers_of_each_send_and_receive(channel: str) -> None:
    row = re.search(rf"^\| {CHANNELS.index(channel)} \| {channel} \| (.+ up); (.+ down) \|$", TEXT, flags=re.MULTILINE)
    assert row is not None
    roles = {peer.partition(".")[0] for peer in OPENS[channel]}
    up = {kind.message.__name__ for kind in KINDS.values() if roles & set(kind.up)}
    down = {kind.message.__name__ for kind in KINDS.values() if roles & set(kind.down)} - {
        "View"
    }  # has its own channels
    assert [set(re.findall(r"`(\w+)`", words)) for words in row.groups()] == [up, down]


def test_text_states_the_current_protocol_version() -> None:
    assert re.findall(r"Protocol version (\d+)", TEXT) == [str(PROTOCOL_VERSION)]


def test_example_frames_in_the_text_decode_as_shown() -> None:
    shown = re.findall(r"^    ((?:[0-9a-f]{2} )+[0-9a-f]{2})  (\w+\(.*\))$", TEXT, flags=re.MULTILINE)
    assert shown
    for digits, message in shown:
        assert repr(decode(bytes.fromhex(digits))) == message


def _short(name: str) -> str:
    """Name of a type as the JavaScript clients write it."""
    if name.endswith(" or nil"):
        return f"{_short(name.removesuffix(' or nil'))}?"
    if name.startswith("array of "):
        return f"{_short(name.removeprefix('array of '))}*"
    if name.startswith("["):
        return f"({','.join(map(_short, name[1:-1].split(', ')))})"
    return name.partition(" ")[0]  # of a map, too


def test_javascript_clients_speak_this_protocol() -> None:
    text = JAVASCRIPT.read_text(encoding="utf-8")
    version, table = re.search(r"PROTOCOL_VERSION = (\d+)n", text), re.search(r"TABLES = `(.*?)`", text, re.DOTALL)
    assert version is not None
    assert table is not None
    assert int(version[1]) == PROTOCOL_VERSION
    entries = [entry.split() for entry in re.split(r"\n(?= *\d)", table[1].strip("\n"))]
    found = {int(kind): [name, *fields] for kind, name, *fields in entries}
    assert found == {
        kind: [name, *(f"{field}:{_short(of)}" for field, of in fields)] for kind, (name, fields) in TABLES.items()
    }
