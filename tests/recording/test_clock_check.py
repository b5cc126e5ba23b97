"""Regular clocks pass with their drift; impossible clocks are found."""

from dataclasses import replace

import numpy as np
import pytest

import rehearsed
from netboard.network.protocol.clock_estimator import ClockEstimator
from netboard.network.protocol.records import ClockRecord
from netboard.recording.integrity.clock_check import check_clocks, contradicts, line_through, stepped
from netboard.recording.integrity.severity import Severity, worst


@pytest.mark.parametrize("drift", [-80.0, -3.0, 0.0, 20.0, 80.0])
def test_drift_of_a_regular_clock_is_the_slope_of_the_fit(drift: float) -> None:
    clocks = rehearsed.probes(50, drift)
    fit = line_through(clocks)
    assert fit is not None
    assert fit.drift_ppm == pytest.approx(drift, abs=0.01)
    assert (fit.beyond, stepped(clocks)) == (0, 0)
    assert worst([*check_clocks(clocks, 0.5, None)]) == Severity.SOUND


def test_live_estimates_of_a_noisy_clock_are_not_refuted() -> None:
    generator = np.random.default_rng(7)
    estimator = ClockEstimator(10_000_000_000)
    clocks = []
    for k in range(2000):
        t0 = 10**12 + k * 200_000_000
        there, back = (50_000 + generator.exponential(200_000, 2)).astype(int).tolist()
        offset = 10**9 + round(k * 0.2 * 37e3)
        t1 = t0 + there + offset
        t3 = t0 + there + 5_000 + back
        estimator.add(t0, t1, t1 + 5_000, t3)
        if k % 5 == 4:  # a server records one probe of five
            clocks.append(
                ClockRecord(
                    len(clocks), "agent.left", t0, t1, t1 + 5_000, t3, estimator.offset_ns, estimator.bound_ns, 0.0
                )
            )
    findings = [*check_clocks(clocks, 0.5, None)]
    assert worst(findings) == Severity.SOUND, findings
    assert "drift +3" in findings[0].text


def test_stepped_clock_is_a_loss() -> None:
    clocks = rehearsed.probes(40)
    clocks[20:] = [
        replace(p, t1_ns=p.t1_ns + 10**7, t2_ns=p.t2_ns + 10**7, offset_ns=p.offset_ns + 10**7) for p in clocks[20:]
    ]
    assert stepped(clocks) > 0
    assert worst([*check_clocks(clocks, 0.5, None)]) == Severity.LOSS


def test_excessive_drift_counts_as_clock_steps() -> None:
    assert stepped(rehearsed.probes(40, 500.0)) > 0
    assert stepped(rehearsed.probes(40, -500.0)) > 0


def test_wide_clock_bound_is_a_loss_only_for_agents_during_trials() -> None:
    clocks = rehearsed.probes(10)
    during = (clocks[0].t0_ns, clocks[-1].t3_ns)
    assert worst([*check_clocks(clocks, 0.05, during)]) == Severity.LOSS
    assert worst([*check_clocks(clocks, 0.05, None)]) == Severity.SOUND
    assert worst([*check_clocks(clocks, 0.5, during)]) == Severity.SOUND
    others = [replace(probe, peer="console") for probe in clocks]
    assert worst([*check_clocks(others, 0.05, during)]) == Severity.SOUND


def test_estimate_may_be_tighter_than_its_probe_but_not_looser() -> None:
    (probe,) = rehearsed.probes(1)
    assert not contradicts(probe)
    assert not contradicts(replace(probe, bound_ns=1000))
    assert contradicts(replace(probe, bound_ns=probe.bound_ns + 10_000))
    assert contradicts(replace(probe, offset_ns=probe.offset_ns + 170_000))
