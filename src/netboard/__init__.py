"""netboard: a networked service for dyadic haptic experiments.

Two people at two stations, a curtain between them, balance a virtual ball on a board by lifting its two ends.
Import from the module that defines a thing; this package re-exports nothing. Where Gymnasium is in use, importing it
registers the environments of `netboard.participants.environments`.
"""

import sys

if "gymnasium" in sys.modules:
    import netboard.participants.environments.registration  # noqa: F401  (it registers them)
