"""Response to a push, against a closed form."""

from math import isnan

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import lambertw

from netboard.analysis.measures.pushes import push_response

RATE, TAU, HEIGHT = 50.0, 0.2, 0.03


def critically_damped(rate: float = RATE, seconds: float = 1.5) -> NDArray[np.float64]:
    """Response of a critically damped mass to an impulse, with its peak at `TAU`."""
    time = np.arange(round(seconds * rate)) / rate
    return HEIGHT * time / TAU * np.exp(1.0 - time / TAU)


@pytest.mark.evidence("truth", push_response)
def test_peak_of_a_critically_damped_mass_is_at_its_time_constant() -> None:
    found = push_response(critically_damped(), RATE)
    assert (found.peak, found.at) == pytest.approx((HEIGHT, TAU))


@pytest.mark.evidence("independent", push_response, by="scipy")
def test_way_back_of_a_critically_damped_mass_is_that_of_the_lambert_function() -> None:
    back = -TAU * float(lambertw(-0.5 / np.e, -1).real)
    assert push_response(critically_damped(1000.0), 1000.0).half_back == pytest.approx(back, abs=1e-5)
    assert push_response(critically_damped(), RATE).half_back == pytest.approx(back, abs=0.002)


@pytest.mark.evidence("properties", push_response, of=("unit", "rate"))
def test_unit_and_rate_scale_the_response() -> None:
    one, other = push_response(critically_damped(), RATE), push_response(1e3 * critically_damped(), RATE)
    assert (other.peak, other.at, other.half_back) == pytest.approx((1e3 * one.peak, one.at, one.half_back))
    slower = push_response(critically_damped(), RATE / 2)
    assert (slower.peak, slower.at, slower.half_back) == pytest.approx((one.peak, 2 * one.at, 2 * one.half_back))


@pytest.mark.evidence("disturbance", push_response, of="holes")
def test_deviation_with_a_gap_has_no_response() -> None:
    deviation = critically_damped()
    deviation[10] = np.nan
    assert all(map(isnan, (push_response(deviation, RATE).peak, push_response(np.empty(0), RATE).peak)))


@pytest.mark.evidence("disturbance", push_response, of="noise")
def test_little_noise_changes_the_response_little() -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.01 * HEIGHT, 75)
    found, plain = push_response(critically_damped() + noise, RATE), push_response(critically_damped(), RATE)
    assert found.peak == pytest.approx(plain.peak, rel=0.03)
    assert found.half_back == pytest.approx(plain.half_back, abs=0.02)


def test_deviation_against_the_push_is_no_peak_and_one_that_stays_never_comes_back() -> None:
    against = push_response(-critically_damped(), RATE)
    assert against.peak == 0.0
    assert isnan(against.at)
    stays = push_response(np.array([0.0, 1.0, 2.0, 1.5]), RATE)
    assert (stays.peak, stays.at) == (2.0, 2 / RATE)
    assert isnan(stays.half_back)
