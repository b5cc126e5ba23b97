"""Lab Streaming Layer streams: values, order and time stamps, with a fake LSL library in memory."""

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from netboard.base.errors import ConfigError
from netboard.base.tables.questionnaires import ANSWERS
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import EventRecord
from netboard.nodes.logger import lsl_outlets
from netboard.nodes.logger.lsl_outlets import MAX_WAITING, Outlets, compare
from netboard.recording.export.lsl_streams import COLUMNS, STREAMS, samples, seconds

MS = 1_000_000
WELCOME = Welcome("3f2a", PROTOCOL_VERSION, 0, "[session]\n")


class Layer:
    """The LSL library in memory, with the samples pushed to each stream."""

    cf_double64, cf_string = 2, 3

    def __init__(self) -> None:
        self.pushed: dict[str, list[tuple[Any, float]]] = {}
        self.infos: dict[str, Layer.Info] = {}

    def local_clock(self) -> float:
        return lsl_outlets.now_ns() / 1e9

    class Info:
        def __init__(self, name: str, kind: str, count: int, rate: float, form: int, source: str) -> None:
            self.name, self.count, self.source = name, count, source
            self.description: dict[str, Any] = {}

        def desc(self) -> "Layer.Info":
            return self

        def append_child(self, name: str) -> "Layer.Info":
            child = Layer.Info(name, "", 0, 0.0, 0, "")
            self.description.setdefault(name, []).append(child.description)
            return child

        def append_child_value(self, name: str, value: str) -> None:
            self.description[name] = value

    StreamInfo = Info

    class Outlet:
        def __init__(self, pushed: list[tuple[Any, float]]) -> None:
            self.pushed = pushed

        def push_chunk(self, values: Any, stamps: list[float]) -> None:
            self.pushed.extend(zip(values, stamps, strict=True))

        def push_sample(self, values: Any, stamp: float = 0.0) -> None:
            self.pushed.append((values[0], stamp))

    def StreamOutlet(self, info: "Layer.Info") -> "Layer.Outlet":
        self.infos[info.name] = info
        return self.Outlet(self.pushed.setdefault(info.name, []))

    def events(self) -> list[dict[str, Any]]:
        return [json.loads(text) for text, _ in self.pushed["netboard.events"]]


@pytest.fixture
def layer(monkeypatch: pytest.MonkeyPatch) -> Layer:
    layer = Layer()
    monkeypatch.setattr(lsl_outlets, "library", lambda: layer)
    return layer


def rows(first: int, count: int) -> NDArray[Any]:
    """Ticks of random bits."""
    found = np.frombuffer(bytearray(np.random.default_rng(first).bytes(count * TICK.itemsize)), TICK)
    found["tick"] = np.arange(first, first + count)
    found["time_ns"] = 10**15 + found["tick"] * MS
    return found


def event(seq: int) -> EventRecord:
    return EventRecord(seq, 3, 10**15 + seq * MS, f"event_{seq}", {"trial": str(seq)})


def test_samples_have_exact_tick_times_on_a_shared_clock(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    outlets.set_clock(-900, 1000)
    ticks = rows(0, 50)
    outlets.take(ticks, [event(0), event(1)])
    values = np.array([value for value, _ in layer.pushed["netboard.ticks"]])
    assert np.array_equal(values.view(np.int64), samples(ticks).view(np.int64))
    assert [stamp for _, stamp in layer.pushed["netboard.ticks"]] == seconds(ticks["time_ns"]).tolist()
    assert layer.pushed["netboard.markers"] == [("event_0", 1e6), ("event_1", 1e6 + 0.001)]
    assert [event["name"] for event in layer.events()] == ["lsl_session", "lsl_clock", "event_0", "event_1"]
    assert layer.events()[1]["details"] == {"offset_ns": "0", "bound_ns": "1000", "one_clock": "true"}
    assert layer.events()[3] == {"seq": 1, "tick": 3, "name": "event_1", "details": {"trial": "1"}}
    assert (outlets.ticks, outlets.events) == (50, 2)


def test_samples_are_held_until_the_clock_offset_is_known(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    outlets.take(rows(0, 10), [event(0)])
    outlets.take(rows(10, 10), [])
    assert layer.pushed["netboard.ticks"] == layer.pushed["netboard.markers"] == []
    outlets.set_clock(7_000_000_000, 50_000)
    assert [value[0] for value, _ in layer.pushed["netboard.ticks"]] == list(range(20))
    assert layer.pushed["netboard.ticks"][0][1] == 1e6 + 7
    assert layer.pushed["netboard.markers"] == [("event_0", 1e6 + 7)]


def test_offset_of_a_remote_clock_is_tracked_and_published(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    for k in range(3):
        outlets.set_clock(7_000_000_000 + k, 50_000)
        outlets.take(rows(k, 1), [])
    stamps = [stamp for _, stamp in layer.pushed["netboard.ticks"]]
    assert stamps == seconds(10**15 + np.arange(3) * MS + 7_000_000_000 + np.arange(3)).tolist()
    entries = [event["details"] for event in layer.events() if event["name"] == "lsl_clock"]
    assert [details["offset_ns"] for details in entries] == ["7000000000", "7000000001", "7000000002"]
    assert {details["one_clock"] for details in entries} == {"false"}


def test_new_session_waits_for_its_own_clock_offset(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    outlets.set_clock(0, 1000)
    outlets.set_clock(5, 900)
    outlets.begin(WELCOME)
    outlets.take(rows(0, 1), [])
    assert layer.pushed["netboard.ticks"] == []
    outlets.set_clock(10**12, 1000)
    assert layer.pushed["netboard.ticks"][0][1] == 1e6 + 1e3
    assert [event["name"] for event in layer.events()] == ["lsl_session", "lsl_clock"] * 2


def test_lost_and_discarded_samples_are_reported_in_the_stream(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    outlets.report_lost(10, 3)
    for k in range(0, MAX_WAITING + 1000, 1000):
        outlets.take(rows(k, 1000), [])
    outlets.set_clock(0, 1000)
    entries = {event["name"]: event["details"] for event in layer.events()}
    assert entries["lsl_lost"] == {"first": "10", "count": "3"}
    assert entries["lsl_unsent"] == {"ticks": str(MAX_WAITING + 1000), "events": "0"}
    assert layer.pushed["netboard.ticks"] == []


def test_samples_of_a_session_that_ends_before_its_clock_is_known_are_reported(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    outlets.take(rows(0, 10), [event(0)])
    outlets.begin(WELCOME)
    assert [event["name"] for event in layer.events()] == ["lsl_session", "lsl_unsent", "lsl_session"]
    assert layer.events()[1]["details"] == {"ticks": "10", "events": "1"}


def test_every_channel_is_described(layer: Layer) -> None:
    Outlets("pair2", 5560)
    assert set(layer.infos) == {"pair2.ticks", "pair2.markers", "pair2.events"}
    for stream in STREAMS:
        info = layer.infos[f"pair2.{stream.name}"]
        assert info.source.endswith(":5560")
        assert len(info.description["channels"][0]["channel"]) == len(stream.channels) == info.count
        assert info.description["clock"][0]["layer_minus_machine_ns"] == "0"
    channels = layer.infos["pair2.ticks"].description["channels"][0]["channel"]
    assert [channel["label"] for channel in channels] == list(COLUMNS)
    force = channels[COLUMNS.index("left_force")]
    assert (force["unit"], force["type"]) == ("N", "Force")


def test_clock_offset_uses_the_shortest_comparison() -> None:
    times = iter([0, 1000, 2000, 2100, 3000, 5000] + [10_000 * k for k in range(600)])
    assert compare(lambda: 4e-6, lambda: next(times)) == (1950, 51)
    same = iter(range(0, 10**6, 50))
    assert compare(lambda: next(same) / 1e9, lambda: next(same)) == (0, 51)


def test_missing_library_error_names_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise RuntimeError("LSL binary library file was not found.\n")

    monkeypatch.setattr(lsl_outlets, "import_module", missing)
    with pytest.raises(ConfigError, match=r'pip install "netboard\[lsl\]" \(LSL binary'):
        Outlets("netboard", 5550)


def test_answers_of_participants_are_not_published(layer: Layer) -> None:
    outlets = Outlets("netboard", 5550)
    outlets.begin(WELCOME)
    outlets.set_clock(0, 1000)
    public = {"station": "left", "block": "1", "complete": "true"}
    private = {"label": "duo", "participant": "P1", "partner": "lqg", "seconds": "3.0", "person.opinion": "a person"}
    outlets.take(rows(0, 1), [EventRecord(0, 3, 10**15, ANSWERS, public | private)])
    assert layer.events()[-1]["details"] == public
    assert layer.pushed["netboard.markers"] == [(ANSWERS, 1e6)]
