"""Kill a process that writes a journal, repeatedly and at random times, and check the remaining file.

Run as a program, in a process without threads: it forks a server for each round, and prints the results. Every round
continues with the journal that the previous one left.
"""

import json
import os
import random
import select
import signal
import sys
from pathlib import Path
from typing import Any

from netboard.base.tables.experiment import Quality
from netboard.recording.recovery.journal_file import Journal
from netboard.task.journal.entries import Entry, line_of, read_lines
from netboard.task.journal.progress import progress_of
from session_model import HEADER, Planned, check, entries_of_run

PLAN = tuple(Planned(number, 60) for number in range(1, 19))
RULES = Quality(repeat="flagged")
LONGEST = 0.04  # of a round [s]


def serve(path: Path, report: int, seed: int) -> None:
    """Continue the session until killed; report each appended entry and the number of durable entries."""
    chance = random.Random(seed)
    if path.exists():
        journal, _, entries, _ = Journal.reopen(path)
    else:
        journal, entries = Journal.create(path, HEADER), ()
    for entry in entries_of_run(chance, f"run{seed}", list(entries), RULES, PLAN):
        os.write(report, b"+" + line_of(entry, "") + b"=%d\n" % journal.durable)
        journal.append(entry)
        ahead = chance.randrange(4)
        while journal.appended - journal.durable > ahead:
            select.select([], [], [], 0.0002)
        os.write(report, b"=%d\n" % journal.durable)
    journal.close()


def read_all(reports: int) -> list[bytes]:
    data = b""
    while part := os.read(reports, 65536):
        data += part
    return data.split(b"\n")[:-1]


def run_round(path: Path, seed: int, chance: random.Random) -> dict[str, Any]:
    """Let a server run for a random time, kill it, and check its journal."""
    before = read_lines(path.read_bytes(), str(path)).entries if path.exists() else ()
    reports, report = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reports)
        serve(path, report, seed)
        os._exit(0)
    os.close(report)
    select.select([reports], [], [])  # it has begun
    select.select([], [], [], chance.uniform(0, LONGEST))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    lines = read_all(reports)
    os.close(reports)
    appended = [_entry(line[1:]) for line in lines if line.startswith(b"+")]
    durable = max((int(line[1:]) for line in lines if line.startswith(b"=")), default=0)
    found = read_lines(path.read_bytes(), str(path))
    entries = list(found.entries)
    assert entries == [*before, *appended][: len(entries)], "the journal differs from the appended entries"
    assert len(entries) >= durable, f"{durable} entries were reported as durable, {len(entries)} are on disk"
    progress = progress_of(found.header, entries, PLAN, str(path))
    check(entries, progress, PLAN)
    return {
        "entries": len(entries),
        "on their way": len(before) + len(appended) - len(entries),
        "torn": len(found.torn),
        "block": progress.block,
        "trial": progress.trial,
        "under way": progress.under_way is not None,
    }


def _entry(line: bytes) -> Entry:
    header = line_of(HEADER, "")
    return read_lines(header + line + b"\n", "report").entries[0]


def main(path: Path, rounds: int, seed: int) -> None:
    """Do some rounds, and print a line of JSON for each."""
    chance = random.Random(seed)
    for number in range(rounds):
        sys.stdout.write(json.dumps(run_round(path, number, chance)) + "\n")
        sys.stdout.flush()  # before the next fork, which would write it too


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
