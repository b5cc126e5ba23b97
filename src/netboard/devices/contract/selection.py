"""Selection of one connected device: by its options, and never by chance.

Two devices of one kind may have equal serial numbers, or none. Which of them a library lists first is chance, and a
hand could get the force of the other one. So a device is opened only if it is the only one that fits the options.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from netboard.base.errors import DeviceNotFound

T = TypeVar("T")


def only(
    fitting: Sequence[T], connected: Sequence[T], kind: str, options: Mapping[str, str], describe: Callable[[T], str]
) -> T:
    """Return the only device that fits; raise `DeviceNotFound` if none fits, or which of them is meant is open.

    ``options``: those that select a device, with their values; ``describe``: how the message describes a device.
    """
    if len(fitting) == 1:
        return fitting[0]
    given = in_words(options)
    if not fitting:
        there = "; ".join(map(describe, connected))
        raise DeviceNotFound(f"there is no {kind} with {given}; there are: {there}")
    what = f"with {given} " if given else ""
    raise DeviceNotFound(
        f"{len(fitting)} devices {kind} {what}are connected, and which of them is meant is open: "
        f"{'; '.join(map(describe, fitting))}; set one of the options {', '.join(options)} in [agents.<side>.options]"
    )


def in_words(options: Mapping[str, str]) -> str:
    """Return the options that select a device, without the empty ones."""
    return " and ".join(f"{key} {value!r}" for key, value in options.items() if value)
