"""The exceptions of netboard.

    NetboardError                what a caller may want to catch
    ├── ConfigError              the configuration is wrong: file, table, key and what was expected
    ├── DeviceError              a haptic device failed
    │   ├── DeviceNotFound       it is not there, or its driver is not
    │   ├── DeviceLost           it was there and is gone
    │   └── DeviceTimeout        it did not answer in time (also a TimeoutError)
    ├── WireError                the peer broke the protocol; never our own mistake
    └── RecordingError           a recording cannot be written, read or trusted

Our own misuse is a ``ValueError`` or ``TypeError``. What is expected to happen (a lost frame, a late tick, a clamped
force, an aborted trial) is a value, an event or a counter, never an exception.
"""


class NetboardError(Exception):
    """Base of everything netboard raises on purpose."""


class ConfigError(NetboardError):
    """The configuration is wrong; the message names file, table and key, and what was expected."""


class DeviceError(NetboardError):
    """A haptic device failed."""


class DeviceNotFound(DeviceError):
    """No such device, or its driver is missing."""


class DeviceLost(DeviceError):
    """The device answered before and does not any more."""


class DeviceTimeout(DeviceError, TimeoutError):
    """The device did not answer in time."""


class WireError(NetboardError):
    """A peer sent something the protocol does not allow."""


class RecordingError(NetboardError):
    """A recording cannot be written, read or trusted."""
