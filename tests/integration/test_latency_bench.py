"""The quick form of the loop benchmarks on real processes, with tables and files."""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from evidence.loop.scale import LightPeers, Peers
from netboard.benchmarks.harness.running import Options
from netboard.benchmarks.loop.bench import Setting, loop, soak
from netboard.benchmarks.loop.stand_in import DeviceName

pytestmark = [pytest.mark.integration, pytest.mark.quiet, pytest.mark.slow, pytest.mark.timeout(240)]


def parts_of(file: Path) -> dict[str, dict[str, Any]]:
    return {part["name"]: part for part in json.loads(file.read_text())["parts"]}


@pytest.mark.sampled(2, of="sessions in real time")
@pytest.mark.parametrize("device", ["virtual", "touch"])
def test_loop_benchmark_measures_the_loop_and_its_baselines(tmp_path: Path, device: DeviceName) -> None:
    folder, file = tmp_path / "found", tmp_path / "found.json"
    loop(Setting(device=device), 1.0, Options(folder, file, quick=True))
    assert file.read_text() == (folder / "results.json").read_text()
    assert {path.suffix for path in folder.iterdir()} >= {".csv", ".json"}
    assert (folder / "loop.png").exists() == (find_spec("matplotlib") is not None)
    assert not (folder / "processes").exists()
    parts = parts_of(file)
    assert set(parts) == {"ratios", "latency", "lateness", "costs", "histogram"}
    assert len(parts["ratios"]["rows"]) == 6
    samples = {row[0]: row[1] for row in parts["latency"]["rows"]}
    assert samples["sample to force"] > 0
    assert samples["echo of the same bytes"] == 2 * 1000
    ticks = {row[0]: row[1] for row in parts["lateness"]["rows"]}
    assert ticks["server's ticks"] > 0
    assert ticks["timer alone"] == 1000
    costs = {row[0]: row[4] for row in parts["costs"]["rows"]}
    assert set(costs) == {"server", "logger", "left agent", "right agent", "echo", "peer left", "peer right"}
    assert all(cost > 0 for cost in costs.values())


@pytest.mark.sampled(2, of="sessions in real time")
def test_lightweight_peers_run_a_trial_on_a_real_server(tmp_path: Path) -> None:
    with LightPeers(tmp_path) as light_peers:
        served = light_peers.serve(Setting().config, 1, Peers(displays=True), 1.0)
    assert {name for name, count in served.counts.items() if count > 0} >= {"forces", "views", "records", "batches"}
    assert served.active > 0
    assert served.ticks.ticks > 0
    assert served.cost.seconds > 0


@pytest.mark.sampled(2, of="sessions in real time")
def test_soak_benchmark_loses_no_records(tmp_path: Path) -> None:
    folder = tmp_path / "soaked"
    assert soak(Setting(), 0.05, 1, Options(folder)) == 0
    parts = parts_of(folder / "results.json")
    assert set(parts) == {"records", "memory", "minutes", "costs"}
    ((dyad, ticks, missing, lost, _, verified, size),) = parts["records"]["rows"]
    assert (dyad, missing, lost, verified) == (1, 0, 0, True)
    assert ticks > 3000
    assert size > 0
