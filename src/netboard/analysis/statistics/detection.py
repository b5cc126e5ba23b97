"""Sensitivity of signal detection theory: how well two kinds of events are told apart, whatever the bias of answers.

The unit of replication is the dyad, as in `netboard.analysis.statistics.estimates`: answers of one dyad are not
independent, so the confidence interval comes from leaving out one dyad at a time.
"""

from math import nan, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri, stdtrit

from netboard.analysis.statistics.estimates import Estimate


def d_prime(hits: float, signals: float, false_alarms: float, others: float) -> float:
    """Return the sensitivity d' = z(H) - z(F) of answers (Green and Swets 1966); NaN without one of the kinds [1].

    The shares have the log-linear correction, H = (hits + 0.5) / (signals + 1) and likewise F, so that a share of 0 or
    1 has a finite d' (Hautus, Behav. Res. Methods Instrum. Comput. 27:46, 1995).

    Parameters
    ----------
    hits : float
        Signals answered as such [1].
    signals : float
        All signals, answered as such or not [1].
    false_alarms : float
        Other events answered as signals [1].
    others : float
        All other events, whatever the answer [1].
    """
    if not 0 <= hits <= signals or not 0 <= false_alarms <= others:
        raise ValueError(
            f"found {hits:g} hits of {signals:g} signals and {false_alarms:g} false alarms of {others:g} others, "
            "expected no more answers than events"
        )
    if signals == 0 or others == 0:
        return nan
    return float(ndtri((hits + 0.5) / (signals + 1.0)) - ndtri((false_alarms + 0.5) / (others + 1.0)))


def clustered_d_prime(counts: ArrayLike, *, level: float = 0.95, unit: str = "dyad") -> Estimate:
    """Estimate d' of the answers of several units, with an interval from the jackknife over units.

    The value is `d_prime` of all answers together. The interval is Student's, of the n pseudo-values
    n d' - (n - 1) d'_(-i), in which d'_(-i) leaves out unit i (Tukey 1958; Miller, Biometrika 61:1, 1974). There is
    none for fewer than two units, or if one unit has all events of a kind.

    Parameters
    ----------
    counts : array_like, shape (n, 4)
        Hits, signals, false alarms and other events of each unit, as in `d_prime` [1].
    """
    table = _table(counts)
    n, whole = len(table), table.sum(axis=0)
    value = d_prime(*whole)
    without = [d_prime(*(whole - own)) for own in table]
    if n < 2 or not np.isfinite(without).all():
        return Estimate(value, nan, nan, level, n, unit, "jackknife")
    pseudo = n * value - (n - 1) * np.array(without)
    half = float(stdtrit(n - 1, 0.5 + level / 2.0)) * float(pseudo.std(ddof=1)) / sqrt(n)
    return Estimate(value, value - half, value + half, level, n, unit, "jackknife")


def _table(counts: ArrayLike) -> NDArray[np.float64]:
    """Return counts as a table of the units that have events."""
    table = np.asarray(counts, dtype=float)
    if table.ndim != 2 or table.shape[1] != 4:
        raise ValueError(f"hits, signals, false alarms and others of each unit are expected, found shape {table.shape}")
    if (table < 0.0).any() or (table[:, 0] > table[:, 1]).any() or (table[:, 2] > table[:, 3]).any():
        raise ValueError("found more answers than events in a unit, or a negative number")
    return np.asarray(table[table[:, 1] + table[:, 3] > 0.0])
