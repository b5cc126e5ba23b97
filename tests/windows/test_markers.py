"""Markers: one byte per event on a serial port (here a pseudo-terminal), and errors for a missing outlet."""

import os
import platform
import sys

import pytest
from display_parts import bytes_from

from netboard.base.errors import ConfigError, NetboardError
from netboard.task.trials.state_machine import Phase
from netboard.windows.participant.markers import CODES, NoMarkers, open_markers

SERVER = "127.0.0.1:5550"

needs_serial = pytest.mark.skipif(sys.platform == "win32", reason="serial ports are POSIX's here")


def test_every_phase_has_a_unique_code():
    assert {phase.name.lower() for phase in Phase} | {"away", "blank"} == set(CODES)
    assert len(set(CODES.values())) == len(CODES)
    assert all(0 < code < 256 for code in CODES.values())


def test_outlet_none_ignores_events():
    markers = open_markers("none", "left", SERVER)
    assert isinstance(markers, NoMarkers)
    markers.mark("running")
    markers.close()


@needs_serial
def test_serial_port_gets_one_byte_per_event():
    ours, theirs = os.openpty()
    markers = open_markers(os.ttyname(theirs), "left", SERVER)
    for event in CODES:
        markers.mark(event)
    assert bytes_from(ours, len(CODES)) == list(CODES.values())
    markers.close()
    os.close(theirs)
    os.close(ours)


@needs_serial
def test_lost_serial_port_raises_an_error_with_the_event():
    ours, theirs = os.openpty()
    markers = open_markers(os.ttyname(theirs), "left", SERVER)
    os.close(theirs)
    os.close(ours)
    with pytest.raises(NetboardError, match="'running' was not sent"):
        markers.mark("running")
    markers.close()


@needs_serial
def test_missing_path_or_plain_file_is_refused_as_a_port(tmp_path):
    with pytest.raises(ConfigError, match=r"\[display\] markers: found .*nowhere"):
        open_markers(str(tmp_path / "nowhere"), "left", SERVER)
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(ConfigError, match="is no serial port"):
        open_markers(str(file), "left", SERVER)


def test_missing_lsl_library_is_refused_with_the_install_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(ConfigError, match=r"pip install .netboard\[lsl\]"):
        open_markers("lsl", "left", SERVER)


def test_lsl_outlet_gets_the_name_of_the_event(monkeypatch):
    class Library:
        IRREGULAR_RATE, cf_string = 0.0, 3

        def __init__(self):
            self.made, self.pushed = [], []

        def StreamInfo(self, *about):
            self.made.append(about)
            return about

        def StreamOutlet(self, _about):
            return self

        def push_sample(self, sample):
            self.pushed.append(sample)

    library = Library()
    monkeypatch.setitem(sys.modules, "pylsl", library)
    markers = open_markers("lsl", "right", SERVER)
    markers.mark("running")
    markers.close()
    source = f"netboard.right@{platform.node()}:{SERVER}"
    assert library.made == [("netboard.right", "Markers", 1, 0.0, 3, source)]
    assert library.pushed == [["running"]]
