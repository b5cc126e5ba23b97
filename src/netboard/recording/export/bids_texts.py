"""Texts of a Motion-BIDS dataset: README, description, and the sidecars that all runs share."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

from netboard.base.files.cells import IN_WORDS
from netboard.base.tables.forces import FORCE_WORDS
from netboard.base.tables.questionnaires import FormQuestion, limits_of
from netboard.recording.export.factors import ExportedFactor
from netboard.recording.export.signals import FRAME, FRAME_TEXT, Signal
from netboard.recording.export.task import ATTEMPT_TEXTS, EVENT_TEXTS, KEYWORDS, PARTNER_TEXT, TASK_TEXT
from netboard.recording.export.trigger_pulses import KINDS
from netboard.stage.perturbing import PERTURBATION
from netboard.task.studies.factors import level_text

MISSING = "n/a"
"""Marker of missing values."""

BIDS_VERSION = "1.11.1"
"""Version of the BIDS standard."""

INSTRUCTIONS = "The standard text of netboard's display."

LATENCY = Signal(
    "latency", "time_ns", "LATENCY", "", MISSING, "nominal time of the tick since the first of the run", "s"
)
"""First column of a motion file."""


def description(studies: Sequence[str]) -> dict[str, Any]:
    """Return the content of ``dataset_description.json``."""
    named = ", ".join(study for study in studies if study)
    return {
        "Name": f"Board and ball: {named}" if named else "Board and ball",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "Keywords": list(KEYWORDS),
        "GeneratedBy": [
            {"Name": "netboard", "Version": version("netboard"), "Description": "exported from its recordings"}
        ],
    }


README = f"""\
# Board and ball

{TASK_TEXT}

## Two people

BIDS has no rule for two people at once. Here:

- each participant is a subject, `sub-<pseudonym>`, or `sub-<dyad><A or B>` if no pseudonym was given;
- both have the same session label, `ses-<dyad><session>`, which no other subject has;
- a run is one recording: a block, or a part of one. Runs are counted over both participants. Files of two subjects with
  equal session and run cover the same time, row by row, on one clock (the server's), with equal `acq_time` and equal
  `latency`;
- each file contains the subject's own stylus with its forces, and the board and the ball: what this participant held
  and saw. The partner's stylus is in the partner's file;
- each `*_sessions.tsv` names the partner, and `docs/dyads.tsv` lists all dyads.

A run of one person alone is a block performed with both hands, or with a robot or a still hand at the other end;
`*_scans.tsv` says which, and has the condition of each run.

## The data

There are 1000 rows a second, one for each tick of the server. A position is that of the newest sample when the tick
began. It may be a millisecond or two older than its row, and is repeated if no new sample arrived (`*_sample` is the
number of the sample, `*_fresh` whether it is valid). BIDS has no channel type for forces: they are MISC channels in N,
as are the virtual board and ball. `*_force_rendered` is n/a where the rendered force is unknown: before the device's
agent had joined, and where the agent was disconnected and did not report it later. `RenderedForceUnknownRows` in the
sidecar counts the rows of the second kind. Positions: {FRAME_TEXT}.

Where ticks are missing, rows are missing (see `latency`). Numbers have the fewest digits that read back as the same
float64. {IN_WORDS} `sourcedata` has the configuration of each recording: every size, mass, stiffness and rule.

## To be filled in

netboard does not know `Authors` and `License` in `dataset_description.json`, ages and sexes in `participants.tsv`, and
the institution in the motion sidecar at the top level.
"""

_MOTION = {
    "TaskName": "board and ball",
    "TaskDescription": TASK_TEXT,
    "SamplingFrequency": 1000,
    "TrackingSystemName": "stylus",
    "InstitutionName": MISSING,
    "InstitutionAddress": MISSING,
    "InstitutionalDepartmentName": MISSING,
    "MissingValues": MISSING,
    "SubjectArtefactDescription": MISSING,
    **{f"{kind}ChannelCount": 0 for kind in ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "MAGN", "ORNT")},
}

_CHANNELS = {
    "reference_frame": {
        "Description": "the frame in which a component is to be read",
        "Levels": {
            FRAME: {
                "Description": FRAME_TEXT,
                "SpatialAxes": "PRS",
                "RotationRule": "right-hand",
                "RotationOrder": "XYZ",
            }
        },
    }
}

_UNITS = {"completion_time": "s", "force_delay_ms": "ms", "perturbation": "N", "seconds": "s"}


def _described(texts: dict[str, str]) -> dict[str, Any]:
    """Return a sidecar that describes columns."""
    return {
        name: {"Description": text} | ({"Units": _UNITS[name]} if name in _UNITS else {})
        for name, text in texts.items()
    }


_EVENTS = {
    "trial_type": {
        "Description": (
            "Events of the types levelling, attempt and perturbation have a duration: they cover the rows of their "
            "phase or of their force, and an attempt begins with the release of the ball even if its row is missing. "
            "All others are instants, at the row that caused them, the last of the previous phase"
        ),
        "Levels": {
            "levelling": "the ball is fixed opposite the target, until the board is level",
            "attempt": "the ball is free",
            PERTURBATION: "a known force acts on ball, board or stylus",
            **EVENT_TEXTS,
            **KINDS,
        },
    },
    "value": {"Description": "code of a TTL pulse, 1 to 255; of a pulse at the input, what the trigger box says of it"},
    "trigger_event": {"Description": "event of the session for which a pulse was made"},
    "trigger_latency": {
        "Description": "time from the nominal time of this event's row to the pulse, as measured for each pulse",
        "Units": "s",
    },
    **_described(ATTEMPT_TEXTS),
    "StimulusPresentation": {"SoftwareName": "netboard", "SoftwareVersion": version("netboard")},
}

_SCAN_TEXTS = {
    "block": "number of the block in the plan, from 1",
    "part": "number of the file within its block, from 1; a restarted logger begins a new file",
    "label": "label of the block",
    "kind": "kind of block, as in the study",
    "role": "purpose of its trials: practice, familiarisation, baseline or test",
    "configuration": "dyadic: two people with one hand each; bimanual: one person with both hands",
    "stylus": "stylus that the subject moved: left, right, or both",
    "force": f"force condition: {FORCE_WORDS}",
    "force_scale": "factor of the haptic feedback",
    "force_delay_ms": "delay of the haptic feedback",
    "catch_trials": "numbers of the trials without haptic feedback",
    "other_hand": "who moves the other end of the board: a subject, own (the other hand), still, or robot",
    "device": "netboard's name for the kind of device",
    "simulated": "true: the movements are those of a simulated participant",
    "stand_ins": "what stood in for a haptic device or a screen, and who confirmed it in which words",
    "pilot": "true: a pilot run",
    "ended": "how the recording ended: complete, if as planned",
    "recording": "file that it was exported from",
}

_FORM_TEXTS = {
    "block": "number of the block that the questions are about, from 1",
    "label": "label of that block",
    "partner": PARTNER_TEXT,
    "complete": "true: the participant finished the form",
    "seconds": "how long the form was open",
}


def of_questionnaire(name: str, questions: Mapping[str, FormQuestion]) -> dict[str, Any]:
    """Return the sidecar of the table of a questionnaire."""
    sidecar: dict[str, Any] = {
        "MeasurementToolMetadata": {"Description": f"questionnaire {name} of the study, at the participants' displays"},
        **_described(_FORM_TEXTS),
    }
    for label, question in questions.items():
        questionnaire, _, column = label.partition(".")
        if questionnaire == name:
            sidecar[column] = {"Description": question.text} | _levels_of_question(question)
    return sidecar


def _levels_of_question(question: FormQuestion) -> dict[str, Any]:
    """Return what the answers to a question mean."""
    match question.kind:
        case "choice":
            return {"Levels": {choice: choice for choice in question.choices}}
        case "number":
            return {"Units": question.unit} if question.unit else {}
        case "text":
            return {}
        case "likert" | "vas":
            low, high = limits_of(question)
            return {"Levels": {f"{low:g}": question.low, f"{high:g}": question.high}}


_PERSON_TEXTS = {
    "age": {"Description": "age of the participant; not known to netboard", "Units": "year"},
    "sex": {"Description": "sex of the participant; not known to netboard"},
    "handedness": {"Description": "dominant hand, as entered in the session's form"},
    "simulated": {"Description": "true: a simulated participant, not a person"},
}

_DYAD_TEXTS = {
    "dyad": "pseudonym of the dyad",
    "session_id": "label of the session, shared by both participants",
    "session_name": "name of the session",
    "study": "name of the study",
    "participant_a": "participant A; n/a if A was in no run",
    "participant_b": "participant B; n/a if B was in no run",
    "runs": "number of runs of either or both participants",
}

_SESSION_TEXTS = {
    "dyad": "pseudonym of the dyad",
    "session_name": "name of the session",
    "partner": "the other participant, who has a session of the same label; n/a if in no run",
}


SIDECARS: dict[str, dict[str, Any]] = {
    "{system}_motion.json": _MOTION,
    "{system}_channels.json": _CHANNELS,
    "{system}_events.json": _EVENTS,
    "scans.json": _described(_SCAN_TEXTS),
    "sessions.json": _described(_SESSION_TEXTS),
    "participants.json": _PERSON_TEXTS,
    "docs/dyads.json": _described(_DYAD_TEXTS),
}
"""Shared sidecars by file name, with the placeholders ``{task}`` and ``{system}``."""

_WITH_FACTORS = {"{system}_events.json": False, "scans.json": False, "participants.json": True}
"""Sidecars of tables with factor columns, and whether only for between-dyad factors."""


def of_factors(factors: Sequence[ExportedFactor], sidecar: str) -> dict[str, Any]:
    """Describe the factor columns of a table."""
    if sidecar not in _WITH_FACTORS:
        return {}
    kept = [one for one in factors if one.scope == "dyad" or not _WITH_FACTORS[sidecar]]
    described: dict[str, Any] = {}
    for one in kept:
        level, *value = one.fields
        levels = {name: level_text(one.of, name) for name in one.of.levels}
        described[level.name] = {"Description": f"level of the factor {one.name}", "Levels": levels}
        if sidecar == "scans.json" and one.scope == "trial":  # a run has several levels, so no single one describes it
            described[level.name] = {"Description": f"levels of the factor {one.name}: {', '.join(levels.values())}"}
        described |= {field.name: {"Description": field.text, "Units": field.unit} for field in value}
    return described
