"""Readers for older recording formats: the differences to the current format only.

Format 3 predicts no column, and does not fold signs; a file's schema says so.

In formats 1 and 2 every tick is a separate msgpack map on the channel ``/tick``, all of equal length. Format 1 lacks
the columns that format 2 added, and its configuration has `haptics` in place of `[block] force`.

Configurations of every format may have keys of simulated participants that the model no longer has. They said how a
hand was moved, not what a recording means, so they are left out.
"""

import json
import re
from collections.abc import Sequence
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.recording.format.channels import CHANNELS, Payload, unpack

TOPIC = "/tick"
"""Channel of the ticks in formats 1 and 2."""

_RETIRED = re.compile(r"^(haptic_gain|haptic_noise|partner_prediction) = .*\n", re.MULTILINE)
_SINCE_2 = frozenset({"left_other", "right_other", "extra", "block_ticks"})
_SINCE_4 = frozenset({"perturbed_ticks", "perturbation"})
"""Columns that recordings of format 4 have if their netboard knew perturbations."""

_HAPTICS = re.compile(r"^haptics = (true|false)$", re.MULTILINE)
_DIFFERENCES_3 = {"vz": 2, "omega": 2, "vp": 4, "left_lead_ns": 0, "right_lead_ns": 0}
"""Orders of the differences that format 4 changed."""

_FORCE = {"true": 'force = "full"', "false": 'force = "none"'}


def schema_4() -> bytes:
    """Return the schema of the ticks in format 4 without perturbations, for files whose own is damaged."""
    schema = json.loads(CHANNELS[0].schema())
    schema["columns"] = [column for column in schema["columns"] if column["name"] not in _SINCE_4]
    return json.dumps(schema).encode()


def schema_3() -> bytes:
    """Return the schema of the ticks in format 3, likewise."""
    schema = json.loads(schema_4())
    for column in schema["columns"]:
        column["differences"] = _DIFFERENCES_3.get(column["name"], column["differences"])
    return json.dumps(schema | {"folded": False, "constants": [], "predictions": {}}).encode()


def config_of(text: str, version: str) -> str:
    """Translate the configuration of an older format into current keys."""
    text = _RETIRED.sub("", text)
    return _HAPTICS.sub(lambda found: _FORCE[found[1]], text) if version == "1" else text


def ticks_of(messages: Sequence[Payload], version: str) -> NDArray[Any]:
    """Decode messages of the ``/tick`` channel into rows.

    They are bit for bit as written; columns that the format lacks are 0.
    """
    missing = _SINCE_4 | _SINCE_2 if version == "1" else _SINCE_4
    template, places, columns = _layout(missing)
    fixed = np.setdiff1d(np.arange(template.size), places)
    if all(len(message) == template.size for message in messages):
        table = np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), template.size)
        if np.array_equal(table[:, fixed], np.broadcast_to(template[fixed], (len(messages), fixed.size))):
            rows = np.zeros((len(messages), TICK.itemsize), np.uint8)
            rows[:, columns] = table[:, places]
            return rows.view(TICK).reshape(len(messages))
    # Another tool has rewritten the map, with its own key order or shorter integers.
    return np.array([_row_by_name(message, missing) for message in messages], TICK)


def _layout(missing: frozenset[str]) -> tuple[NDArray[np.uint8], NDArray[np.intp], NDArray[np.intp]]:
    """Return a template message with zero values, the positions of its values, and their positions in a `TICK` row."""
    fields = {name: at for name, at in (TICK.fields or {}).items() if name not in missing}
    message = bytearray(msgpack.Packer().pack_map_header(len(fields)))
    places: list[int] = []
    columns: list[int] = []
    for name, (dtype, offset, *_) in fields.items():
        message += msgpack.packb(name) + (b"\xd3" if dtype.kind == "i" else b"\xcb")
        # A row is little-endian, msgpack is big-endian.
        places += range(len(message) + 7, len(message) - 1, -1)
        columns += range(offset, offset + 8)
        message += bytes(8)
    return np.frombuffer(bytes(message), np.uint8), np.array(places), np.array(columns)


def _row_by_name(message: Payload, missing: frozenset[str]) -> tuple[Any, ...]:
    values = unpack(message) | dict.fromkeys(missing, 0)
    try:
        return tuple(values[name] for name in TICK.names or ())
    except KeyError as unknown:
        raise RecordingError(f"a tick without the field {unknown}: written by another version of netboard?") from None
