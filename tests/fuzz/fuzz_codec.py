"""The codec, fuzzed by libFuzzer, which looks for bytes that take a way through it that none before took.

    pip install -e .[fuzz]
    python tests/fuzz/fuzz_codec.py -runs=1000000

Takes the options of libFuzzer and folders with frames to begin with; it keeps what it finds in the first of them.
Half of the frames are libFuzzer's mutations, half are those of `netboard.benchmarks.faults.mutants`. What makes it fail
is written to a file ``crash-...``, which it takes as an argument to try it again.
"""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["netboard.network.protocol.codec"]):
    from wire_oracle import judge

from netboard.benchmarks.faults.mutants import Mutants

FRAMES = Path(__file__).parent.parent / "data" / "frames"
MUTANTS = Mutants([path.read_bytes() for path in sorted(FRAMES.glob("*.bin"))], seed=1)


def mutate(data: bytes, max_size: int, seed: int) -> bytes:
    """One of the next frames to try."""
    return next(MUTANTS)[:max_size] if seed & 1 else atheris.Mutate(data, max_size)


def main() -> None:
    """Fuzz."""
    with tempfile.TemporaryDirectory() as found:
        own = [] if any(not argument.startswith("-") for argument in sys.argv[1:]) else [found, str(FRAMES)]
        atheris.Setup([*sys.argv, *own], judge_any, custom_mutator=mutate)
        atheris.Fuzz()


def judge_any(data: bytes) -> None:
    """Ask the codec, and the oracle."""
    judge(data)


if __name__ == "__main__":
    main()
