"""Process that records Lab Streaming Layer streams and ends after a number of markers.

Usage: lsl_inlet.py NAME FILE MARKER TIMES SECONDS; writes samples, time stamps and stream metadata to FILE.
"""

import sys
import time

import numpy as np
import pylsl

STREAMS = ("ticks", "markers", "events")
CHUNK_SIZE = 1000


def main(name: str, file: str, last: str, times: int, seconds: float) -> int:
    """Record the streams."""
    until = time.monotonic() + seconds
    inlets = {}
    for stream in STREAMS:
        found = pylsl.resolve_byprop("name", f"{name}.{stream}", timeout=seconds)
        if not found:
            return 1
        inlets[stream] = pylsl.StreamInlet(found[0], max_buflen=360, recover=True)
    about = {f"{stream}_xml": np.array(inlet.info(seconds).as_xml()) for stream, inlet in inlets.items()}
    for inlet in inlets.values():
        inlet.open_stream(seconds)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    values: dict[str, list] = {stream: [] for stream in STREAMS}
    stamps: dict[str, list] = {stream: [] for stream in STREAMS}
    ended, newest = False, time.monotonic()
    while time.monotonic() < until and not (ended and time.monotonic() - newest > 1.0):
        for stream, inlet in inlets.items():
            samples, when = inlet.pull_chunk(0.0, CHUNK_SIZE)
            values[stream] += samples
            stamps[stream] += when
            newest = time.monotonic() if samples else newest
        ended = ended or values["markers"].count([last]) == times
        time.sleep(0.001)
    np.savez(
        file,
        ticks=np.array(values["ticks"], np.float64),
        ticks_stamps=np.array(stamps["ticks"]),
        markers=np.array([sample[0] for sample in values["markers"]]),
        markers_stamps=np.array(stamps["markers"]),
        events=np.array([sample[0] for sample in values["events"]]),
        events_stamps=np.array(stamps["events"]),
        **about,
    )
    return 0 if ended else 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]), float(sys.argv[5])))
