"""The last bits of a measure do not depend on how many threads the linear algebra library may use."""

import os
import subprocess
import sys

import pytest

MEASURE = """
import numpy as np
from netboard.analysis.measures.lags import lag_of
from netboard.analysis.measures.smoothness import log_dimensionless_jerk
drawn = np.random.default_rng(7).standard_normal((2, 60_000)).cumsum(axis=1)
for stop in range(12_000, 60_000, 4_000):
    one, other = drawn[:, :stop]
    lag = lag_of(one, other, 1000.0, longest=0.5)
    print(*(float(number).hex() for number in (lag.coefficient, log_dimensionless_jerk(np.abs(one), 1000.0))))
"""


def measured_with(threads: int) -> str:
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    environment = {**os.environ, **dict.fromkeys(names, str(threads))}
    done = subprocess.run([sys.executable, "-c", MEASURE], env=environment, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.slow
def test_measures_are_bit_identical_with_one_thread_and_four() -> None:
    assert measured_with(1) == measured_with(4)
