"""What a recorder of the Lab Streaming Layer does, as a process: take all streams of a rig until a marker comes.

Usage: lsl_inlet.py NAME FILE MARKER SECONDS; writes samples, stamps, times of arrival and the streams' own words to FILE.
"""

import sys
import time

import numpy as np
import pylsl

STREAMS = ("ticks", "markers", "events")
AT_ONCE = 1000


def main(name: str, file: str, last: str, seconds: float) -> int:
    """Record."""
    until = time.monotonic() + seconds
    inlets = {}
    for stream in STREAMS:
        found = pylsl.resolve_byprop("name", f"{name}.{stream}", timeout=seconds)
        if not found:
            print(f"no stream {name}.{stream}", flush=True)
            return 1
        inlets[stream] = pylsl.StreamInlet(found[0], max_buflen=360, recover=True)
    about = {f"{stream}_xml": np.array(inlet.info(10.0).as_xml()) for stream, inlet in inlets.items()}
    for inlet in inlets.values():
        inlet.open_stream(10.0)
    corrections = {f"{stream}_correction": np.array(inlet.time_correction(10.0)) for stream, inlet in inlets.items()}
    print("ready", flush=True)
    values: dict[str, list] = {stream: [] for stream in STREAMS}
    stamps: dict[str, list] = {stream: [] for stream in STREAMS}
    arrivals: list[float] = []
    ended = 0.0
    while time.monotonic() < until and not (ended and time.monotonic() - ended > 1.0):
        for stream, inlet in inlets.items():
            samples, times = inlet.pull_chunk(0.0, AT_ONCE)
            values[stream] += samples
            stamps[stream] += times
            if stream == "ticks":
                arrivals += [pylsl.local_clock()] * len(times)
            elif stream == "markers" and [last] in samples:
                ended = time.monotonic()
        time.sleep(0.001)
    np.savez(
        file,
        ticks=np.array(values["ticks"], np.float64),
        ticks_stamps=np.array(stamps["ticks"]),
        arrivals=np.array(arrivals),
        markers=np.array([sample[0] for sample in values["markers"]]),
        markers_stamps=np.array(stamps["markers"]),
        events=np.array([sample[0] for sample in values["events"]]),
        events_stamps=np.array(stamps["events"]),
        **about,
        **corrections,
    )
    return 0 if ended else 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4])))
