"""A rehearsed study of two factors: its recordings alone give a report whose head has the declared interaction."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.report.html import write_report
from netboard.analysis.topics.primary import picture, primary
from netboard.analysis.topics.result import table_of
from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse_all
from netboard.recording.export.runs import runs_of
from netboard.task.plans.plan import blocks_of
from netboard.task.studies.study import parse_study
from pages import read_page
from report_studies import provenance_of

STUDY = """
name = "haptics_by_partner"
block.trials = 2
orders.main = "4 duo"
[factors.haptics]
levels.on.block.force = "full"
levels.off.block.force = "none"
[factors.partner]
levels.person = {}
levels.robot.block.right = "robot"
[kinds.duo]
[analysis]
question = "Does haptic feedback help more with a person than with a robot?"
primary = "completion time"
contrast = "haptics x partner"
"""
DYADS = 4


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyData:
    folder = tmp_path_factory.mktemp("rehearsed")
    for dyad in range(1, DYADS + 1):
        rehearse_all(jobs_of(blocks_of(Config(), parse_study(STUDY), 1, dyad), 1, dyad, folder), 1)
    readings = Readings()
    return study_of([measure(run, readings) for run in runs_of(sorted(folder.glob("*.mcap")))], readings)


@pytest.mark.slow
def test_head_has_the_interaction_of_an_independent_computation(study: StudyData, tmp_path: Path) -> None:
    results = table_of(primary(study).results)
    page = read_page(write_report(tmp_path, study, results, [picture(study)], provenance_of(study)))
    (head,) = [one for one in page.all("section") if one["aria-labelledby"] == "question"]
    assert head.all("p")[0].text == "Does haptic feedback help more with a person than with a robot?"

    felt, robot = study.counted["force"] == "full", study.counted["partner"] == "robot partner"
    logs = np.log(study.counted["completion"]).groupby([study.counted["dyad"], felt, robot]).mean().unstack([1, 2])
    gaps = (logs[True, False] - logs[False, False]) - (logs[True, True] - logs[False, True])
    test = stats.ttest_1samp(gaps, 0.0)
    low, high = np.exp(test.confidence_interval(0.95))

    group = "haptics: on vs off x partner: person vs robot"
    mine = results[results["group"] == group].set_index("quantity")
    ratio = mine.loc["completion time: ratio, t test"]
    assert (ratio["value"], ratio["low"], ratio["high"]) == pytest.approx((np.exp(gaps.mean()), low, high), rel=1e-12)
    assert mine.loc["completion time: p, t test", "value"] == pytest.approx(test.pvalue, rel=1e-12)
    rows = {row.all("th")[0].text: [cell.text for cell in row.all("td")] for row in head.all("table")[1].all("tr")[1:]}
    assert rows[group][6] == f"{test.pvalue:.3f}"
    assert rows[group][4] == f"{test.statistic:.2f}".replace("-", "−")
    assert f"t({DYADS - 1}) = {rows[group][4]}, p = {rows[group][6]}, {DYADS} dyads" in head.text
