"""Options that several commands have, and the examples in help texts.

Importing a command must be quick, because ``netboard --help`` imports them all: libraries are imported when they are
needed, and so is `netboard.base.config`.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError

Side = Literal["left", "right"]  # as in netboard.base.config, which takes too long to import here

MOST_TRIALS, MOST_SEED = 10_000, 2**31 - 1
"""Limits of the settings block.trials and block.seed, of which the module takes too long to import here."""

USED_FILE = "Configuration file (TOML); default: ./netboard.toml if it exists, else the built-in defaults."

ConfigFile = Annotated[Path | None, typer.Option("--config", "-c", metavar="FILE", help=USED_FILE)]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="TABLE.KEY=VALUE", help="Override one setting; repeat for several.")
]
HandSide = Annotated[Side, typer.Option(help="Side of the board that the device moves.")]
RobotPartnerName = Annotated[
    str | None,
    typer.Option(
        "--partner",
        metavar="NAME|FILE",
        help="A robot partner holds the stylus of a simulated device in place of a person: its name, such as robot (a "
        "simulated participant), or a file of weights of netboard train.",
    ),
]
Agreed = Annotated[bool, typer.Option("--yes", help="Do not ask; everybody at the device has agreed.")]
ReplaceProfile = Annotated[bool, typer.Option("--replace", help="Keep no backup (.bak) of the previous profile.")]
Json = Annotated[bool, typer.Option("--json", help="Print one line of JSON.")]
JsonObject = Annotated[bool, typer.Option("--json", help="Print one JSON object, in SI units.")]
Screenshot = Annotated[Path | None, typer.Option(metavar="FILE", help="Save the first frame as a PNG file, then stop.")]
ScreenshotDelay = Annotated[
    float | None,
    typer.Option(
        min=0, metavar="SECONDS", help="Take the screenshot this long after the first data, and keep the window open."
    ),
]
Offscreen = Annotated[bool, typer.Option("--offscreen", help="Draw windows off screen, where nobody sees them.")]
Theme = Annotated[
    Literal["system", "light", "dark"], typer.Option(help="Colours of the window; system: as the desktop is set.")
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help='Permit network.curve = "off" at an address that other machines can reach.')
]
Model = Annotated[
    Literal["paper", "lagrangian"] | None, typer.Option(help="Physics model; the same as --set physics.model=...")
]
STUDY_HELP = "Name of a built-in study (netboard plan list) or a study file; NAME:ORDER selects another order."
Study = Annotated[str, typer.Argument(metavar="STUDY", help=STUDY_HELP)]
SessionOf = Annotated[
    str | None, typer.Option(metavar="NAME|FILE", help="Run a session of this study instead of a single block.")
]
Dyad = Annotated[int, typer.Option(min=1, help="Number of the dyad in the study.")]
PlanSeed = Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Random seed of the plan.")]
POSTERIOR = "FILE|bimanual_off"
"""What a posterior is taken from: a file of netboard participants fit, or the one that comes with netboard."""
Posterior = Annotated[
    str | None,
    typer.Option(
        metavar=POSTERIOR,
        help="Draw the usual participant of each virtual study from a posterior: a file of netboard participants fit, "
        "or the one that comes with netboard.",
    ),
]
Studies = Annotated[int, typer.Option(min=1, max=999_999, help="Number of virtual studies.")]
CohortSeed = Annotated[int, typer.Option(min=0, max=2146, help="Random seed of the whole cohort.")]
SessionNumber = Annotated[int, typer.Option("--session", min=1, help="Number of the session in the dyad's plan.")]
StudySeed = Annotated[int, typer.Option(min=0, help="Random seed of the study's plan.")]
Resume = Annotated[bool, typer.Option("--resume", help="Resume the session where it was interrupted.")]
Yes = Annotated[bool, typer.Option("--yes", help="Resume without asking.")]
Confirmation = Annotated[
    str,
    typer.Option(
        "--confirm",
        metavar="WORDS",
        help="In a real session, confirm a stand-in for a device or a screen in words, as netboard control confirm "
        "does: 'left device simulated'.",
    ),
]
Autostart = Annotated[
    bool | None,
    typer.Option(
        "--autostart/--no-autostart",
        help="Start each block as soon as all peers are connected. Default: yes for a single block; no for a "
        "study, where the operator starts blocks (netboard console).",
    ),
]
Blocks = Annotated[int | None, typer.Option(min=1, help="Run only the first blocks (pilot runs).")]
Trials = Annotated[int | None, typer.Option(min=1, help="Limit the trials per block (pilot runs).")]
RecordingFile = Annotated[Path, typer.Argument(metavar="RECORDING", help="The recording (.mcap).")]
Recordings = Annotated[list[Path], typer.Argument(metavar="RECORDING", help="Recordings, or folders of recordings.")]
Workers = Annotated[int | None, typer.Option(min=1, metavar="N", help="Processes; default: one per core.")]
Dask = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Use a Dask cluster, for example tcp://10.0.0.5:8786.")
]
SettingsFile = Annotated[
    Path | None,
    typer.Option("--settings", metavar="FILE", help="Settings of the analysis (TOML); default: those of the paper."),
]
NewFolder = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FOLDER", help="New folder; default: named after the first recording."),
]


def refuse_without_study(context: typer.Context, study: str | None, *names: str) -> None:
    """Refuse given options that say which part of a study is run if there is no study, instead of ignoring them."""
    sources = {name: context.get_parameter_source(name) for name in names}
    given = [f"--{name}" for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"]
    if study is None and given:
        raise ConfigError(
            f"{', '.join(given)}: found without --study; expected a study, or [session] and [block] in the settings"
        )


def changes_of(overrides: Sequence[str] | None, model: str | None) -> list[str]:
    """Return the overrides, and --model as another one."""
    return [*(overrides or ()), *([f"physics.model={model}"] if model else ())]


def settings_of(config: Path | None, overrides: Sequence[str]) -> list[str]:
    """Return the options with which another command reads the same configuration."""
    found = ["-c", str(config)] if config else []
    return found + [word for setting in overrides for word in ("--set", setting)]


def partner_settings(side: str, partner: str | None) -> list[str]:
    """Return the settings with which a robot partner holds the stylus of a side; none without one.

    ``partner``: its name, or a file of weights of the learned partner, which has a suffix.
    """
    if partner is None:
        return []
    if not Path(partner).suffix:
        return [f"agents.{side}.device=partner", f"agents.{side}.options.partner={partner}"]
    weights = json.dumps(str(Path(partner).resolve()))  # a string in TOML, too
    return [
        f"agents.{side}.device=partner",
        f"agents.{side}.options.partner=learned",
        f"partners.{side}.weights={weights}",
    ]


def examples(*lines: str) -> str:
    """Return the epilog of a help text."""
    return "\n\n".join(("Examples:", *(f"  {line}" for line in lines)))
