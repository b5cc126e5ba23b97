"""Coverage-guided fuzzing of the codec with libFuzzer (atheris).

    pip install -e .[fuzz]
    PYTHONPATH=tests python -m evidence.fuzz.fuzz_codec -runs=1000000

The arguments are libFuzzer's options and corpus folders; new inputs are saved in the first folder. Half of the frames
are libFuzzer's mutations, half come from `evidence.faults.malformed_frames`. A frame that fails is written
to a file ``crash-...``; give that file as an argument to try the frame again.
"""

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["netboard.network.protocol.codec"]):
    from evidence.fuzz.reference_decoder import decode_with_both

from evidence.faults.malformed_frames import MalformedFrames

FRAMES = Path(__file__).parents[2] / "data" / "frames"
MALFORMED = MalformedFrames([path.read_bytes() for path in sorted(FRAMES.glob("*.bin"))], seed=1)


def mutate(data: bytes, max_size: int, seed: int) -> bytes:
    """Return the next frame to test."""
    return next(MALFORMED)[:max_size] if seed & 1 else atheris.Mutate(data, max_size)


def main() -> None:
    """Run libFuzzer, with the frames of the tests as its corpus unless another folder is given."""
    with tempfile.TemporaryDirectory() as new_inputs:
        has_corpus = any(not argument.startswith("-") for argument in sys.argv[1:])
        corpus = [] if has_corpus else [new_inputs, str(FRAMES)]
        atheris.Setup([*sys.argv, *corpus], compare_decoders, custom_mutator=mutate)
        atheris.Fuzz()


def compare_decoders(data: bytes) -> None:
    """Decode a frame with the codec and with the reference decoder; libFuzzer allows no return value."""
    decode_with_both(data)


if __name__ == "__main__":
    main()
