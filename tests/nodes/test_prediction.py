"""The doctor's predictions: loops with a closed form, Poisson intervals, a short exchange."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import poisson

from netboard.base.errors import NetboardError
from netboard.base.finding import Finding
from netboard.base.tables.rig import Realtime
from netboard.nodes.doctor import exchange, prediction
from netboard.nodes.doctor.exchange import ExchangeTimes

WORK_MS = prediction.WORK_US * 1e-3


def uniform_exchanges(count: int = 1000) -> ExchangeTimes:
    """Exchanges of constant duration; the right agent's latency to the server is 50 us longer."""
    woke = np.full((2, count), 50_000)
    up = np.array([[100_000], [150_000]]) + np.zeros((2, count), np.int64)
    return ExchangeTimes(woke, up, np.full((2, count), 80_000), prediction.WORK_EXCHANGE_US)


def test_loop_time_includes_the_later_sample() -> None:
    found = prediction.predict(uniform_exchanges(), 0, 10_000)
    assert found.p50_ms == pytest.approx(0.150 + 0.080 + WORK_MS)
    assert found.p99_ms == pytest.approx(found.p50_ms)


def test_predicted_work_scales_with_the_cost_of_an_exchange() -> None:
    half = replace(uniform_exchanges(), server_us=prediction.WORK_EXCHANGE_US / 2)
    assert prediction.predict(half, 0, 10_000).p50_ms == pytest.approx(0.230 + WORK_MS / 2)


def test_missed_sample_closes_no_loop_and_delays_the_other_side() -> None:
    exchanges = uniform_exchanges()
    exchanges.up_ns[1, 7] = 2_000_000
    loops = prediction.loops_ns(exchanges) * 1e-6
    assert loops.size == 2 * 1000 - 1
    deadline = 0.5 * (0.150 + 0.200) + 0.300
    assert loops.max() == pytest.approx(deadline + 0.050 - 0.050 + 0.080 + WORK_MS)


@pytest.mark.parametrize("missed", [0, 3, 61])
def test_confidence_interval_of_deadline_misses_is_exact(missed: int) -> None:
    found = prediction.predict(uniform_exchanges(), missed, 10_000)
    assert found.missed == pytest.approx(missed * 10)
    assert poisson.cdf(missed, found.missed_high / 10) == pytest.approx(0.025)
    assert (
        found.missed_low == 0 if not missed else poisson.sf(missed - 1, found.missed_low / 10) == pytest.approx(0.025)
    )


def test_good_loop_is_green_and_bad_loop_names_its_causes() -> None:
    predicted = prediction.predict(uniform_exchanges(), 1, 10_000)
    good = prediction.finding(predicted)
    bad = prediction.finding(prediction.predict(uniform_exchanges(), 61, 4_000))
    assert (good.colour, good.advice, bad.colour) == ("green", "", "yellow")
    assert f"p50 {predicted.p50_ms:.2f}" in good.found
    others = [
        Finding("CPU governor", "yellow", "powersave", "do"),
        Finding("real-time scheduling", "red", "refused", "do"),
        Finding("disk space", "red", "1 GB", "do"),
        Finding("kernel preemption", "green", "full"),
    ]
    assert prediction.with_limits([bad, *others])[0].advice == "limited by real-time scheduling, CPU governor"
    assert prediction.with_limits([good, *others]) == [good, *others]
    assert "what else runs" in prediction.with_limits([bad])[0].advice


@pytest.mark.slow
def test_exchange_between_processes_is_measured() -> None:
    progress: list[float] = []
    found = exchange.measure(Realtime(scheduling=False, lock_memory=False), 0.1, progress.append)
    assert found.woke_ns.shape == found.up_ns.shape == found.down_ns.shape == (2, 100)
    assert min(found.woke_ns.min(), found.up_ns.min(), found.down_ns.min()) >= 0
    assert found.server_us > 0
    assert progress == sorted(progress)


@pytest.mark.slow
def test_failed_exchange_reports_its_reason() -> None:
    with (
        pytest.raises(NetboardError, match="the exchange over loopback failed: KeyError: 'place'"),
        exchange._started([{}]),
    ):
        pass
