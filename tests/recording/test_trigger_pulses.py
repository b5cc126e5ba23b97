"""Pulses of a trigger box in the exports: at their own times, with code and latency."""

from pathlib import Path

import h5py
import pytest
import pyxdf
from dyads import dyad
from test_bids_export import table

from netboard.network.protocol.records import EventRecord
from netboard.network.protocol.triggers import TRIGGER, TRIGGER_INPUT, TRIGGER_LOST
from netboard.recording.export import bids, nwb, xdf
from netboard.recording.export.trigger_pulses import onset_ns, pulses_of
from netboard.recording.files.reader import Recording
from netboard.testing.difficult_recording import make_rows

MS = 1_000_000
FIRST_NS = int(make_rows(1)["time_ns"][0])
LAST_NS = int(make_rows(1)["time_ns"][-1])

MADE = {"event": "held", "event_tick": "7", "code": "4", "pulse_ns": str(FIRST_NS + 8 * MS), "bound_us": "90.0"}
MADE |= {"latency_us": "700.5", "waited_us": "10.0", "received_us": "600.0", "width_us": "5100.0"}
CAME = {"code": "1", "pulse_ns": str(FIRST_NS + 12 * MS), "bound_us": "90.0"}
EVENTS = (
    EventRecord(1, 20, LAST_NS + MS, TRIGGER, MADE),
    EventRecord(2, 20, LAST_NS + MS, TRIGGER_INPUT, CAME),
    EventRecord(3, 20, LAST_NS + MS, TRIGGER_LOST, {"event": "fell", "code": "5", "reason": "it was unplugged"}),
)


def quiet(what: str, done: int, total: int) -> None:
    """Ignore the progress."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dyad(tmp_path_factory.mktemp("pulses") / "S_2_D-07_block01.mcap", events=EVENTS)


def test_pulses_have_the_time_at_which_they_began(recording: Path) -> None:
    with Recording(recording) as found:
        made, came = pulses_of(found)
    assert (made.time_ns, made.event, made.code) == (FIRST_NS + 8 * MS, "held", 4)
    assert (made.width, made.latency) == (pytest.approx(0.0051), pytest.approx(0.0007005))
    assert (came.time_ns, came.event, came.code) == (FIRST_NS + 12 * MS, "", 1)
    assert [onset_ns(event) for event in EVENTS] == [FIRST_NS + 8 * MS, FIRST_NS + 12 * MS, LAST_NS + MS]


def test_pulse_without_a_valid_time_has_that_of_its_event() -> None:
    assert onset_ns(EventRecord(0, 0, 77, TRIGGER, {"pulse_ns": "soon"})) == 77
    assert onset_ns(EventRecord(0, 0, 77, "held", {"pulse_ns": "5"})) == 77


def test_bids_has_each_pulse_with_its_code_as_value(recording: Path, tmp_path: Path) -> None:
    bids.write([recording], tmp_path, quiet)
    events = table(next(tmp_path.glob("sub-*/ses-*/motion/*_events.tsv")))
    made, came = (next(row for row in events if row["trial_type"] == kind) for kind in (TRIGGER, TRIGGER_INPUT))
    assert (made["onset"], made["duration"], made["value"]) == ("0.008", "0.0051", "4")
    assert (made["trigger_event"], made["trigger_latency"], made["outcome"]) == ("held", "0.0007005", "n/a")
    assert (came["onset"], came["duration"], came["value"], came["trigger_event"]) == ("0.012", "n/a", "1", "n/a")
    assert all(row["value"] == "n/a" for row in events if row not in (made, came))
    assert [float(row["onset"]) for row in events] == sorted(float(row["onset"]) for row in events)


def test_nwb_has_a_table_of_pulses(recording: Path, tmp_path: Path) -> None:
    nwb.write([recording], tmp_path, quiet)
    with h5py.File(next(tmp_path.glob("sub-*/*.nwb"))) as file:
        pulses = file["events/trigger_pulses"]
        assert pulses["timestamp"][:].tolist() == pytest.approx([0.008, 0.012])
        assert pulses["code"][:].tolist() == [4, 1]
        assert pulses["latency"][0] == pytest.approx(0.0007005)


def test_xdf_stamps_a_pulse_with_its_own_time(recording: Path, tmp_path: Path) -> None:
    xdf.write([recording], tmp_path, quiet)
    streams, _ = pyxdf.load_xdf(next(tmp_path.glob("*.xdf")), dejitter_timestamps=False)
    (markers,) = (stream for stream in streams if stream["info"]["name"] == ["netboard.markers"])
    stamps = {name: stamp for (name,), stamp in zip(markers["time_series"], markers["time_stamps"], strict=True)}
    assert stamps[TRIGGER] == (FIRST_NS + 8 * MS) / 1e9
    assert stamps[TRIGGER_INPUT] == (FIRST_NS + 12 * MS) / 1e9
    assert stamps[TRIGGER_LOST] == (LAST_NS + MS) / 1e9
