"""Notes on completion times that come from the recording, or that differ from the recorded ones.

A recorded time replaces the computed one if the samples show no hold. Each note names the columns of the table of
trials to compare.
"""

import numpy as np

from netboard.analysis.extraction.study import Study
from netboard.analysis.extraction.trials import RATE

NEAR = 1.5 / RATE
"""Tolerance between recorded and recomputed times: one tick, because the server counts the tick of entry [s]."""


def notes(study: Study) -> tuple[str, ...]:
    """Return notes on successes whose samples show no hold, or another completion time than the recorded one."""
    done = study.trials[study.trials["outcome"] == "success"]
    from_recording = int((done["completion_source"] == "recording").sum())
    apart = np.abs(done["completion"] - done["recorded_completion"])
    differ = apart[(done["completion_source"] == "samples") & (apart > NEAR)]
    told = []
    if from_recording:
        told.append(
            f"{from_recording} of {len(done)} completion times are those of the recording (completion_source in the "
            "table of trials): the samples show no hold."
        )
    if len(differ):
        told.append(
            f"{len(differ)} of {len(done)} completion times differ from the recorded ones by more than a tick, by "
            f"{1e3 * differ.max():.0f} ms at most: compare the columns completion and recorded_completion of the table "
            "of trials."
        )
    return tuple(told)
