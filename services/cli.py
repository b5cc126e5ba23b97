"""The ``netboard`` command: what can be asked, and nothing of how it is done.

A service is imported when it is asked for, so that ``netboard --help`` is quick and a machine needs only the libraries
of the services it runs. Exit codes: 0 clean, 1 fault, 2 wrong configuration or usage. What goes wrong on purpose
(`NetboardError`) is one line on stderr; ``--debug`` shows where it came from.
"""

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from netboard.config import MOUSE, SIDES, Config, Side
from netboard.errors import ConfigError, NetboardError
from netboard.services import bench, configuration, devices, keys, plan, recordings, session
from netboard.services.configuration import ConfigFile, Overrides
from netboard.services.wording import Screenshot, examples

OK, FAULT, WRONG = 0, 1, 2


class Guarded(TyperGroup):
    """A group of commands that turns netboard's own errors into one line and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        try:
            return super().invoke(ctx)
        except NetboardError as error:
            if ctx.params["debug"]:
                raise
            typer.secho(f"netboard: {error}", err=True, fg=typer.colors.RED)
            raise typer.Exit(WRONG if isinstance(error, ConfigError) else FAULT) from None
        except KeyboardInterrupt:
            typer.secho("netboard: interrupted", err=True, fg=typer.colors.RED)
            raise typer.Exit(FAULT) from None


app = typer.Typer(
    cls=Guarded,
    name="netboard",
    help="Two people, a curtain between them, balance a virtual ball on a board: a networked dyadic haptic experiment.",
    epilog=examples(
        "netboard demo", "netboard config init", "netboard server -c rig.toml", "netboard agent --side left -c rig.toml"
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["--help", "-h"]},
)
config_app = typer.Typer(help="Check, show or write the configuration file.", no_args_is_help=True)
app.add_typer(config_app, name="config")
app.add_typer(bench.app, name="bench")
app.add_typer(devices.app, name="devices")
app.add_typer(keys.app, name="keys")
app.add_typer(plan.app, name="plan")
app.add_typer(session.app, name="session")


def _print_version(wanted: bool) -> None:
    """Print the version and stop, if asked."""
    if wanted:
        typer.echo(f"netboard {version('netboard')} (Python {platform.python_version()}, {platform.platform()})")
        raise typer.Exit(OK)


@app.callback()
def root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the full traceback of an error.")] = False,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and stop.")
    ] = False,
) -> None:
    """Take the options that go before the command; `Guarded` reads ``debug``."""


Dyad = Annotated[int, typer.Option(min=1, help="Number of the dyad in the study.")]
SessionNumber = Annotated[int, typer.Option("--session", min=1, help="Number of the session in the dyad's plan.")]


@app.command(
    epilog=examples(
        "netboard server",
        "netboard server -c rig.toml --no-autostart",
        "netboard server -c rig.toml --study paper --dyad 3",
        "netboard server -c rig.toml --study paper --dyad 3 --resume",
        "netboard server -c a.toml -c b.toml",
    )
)
def server(
    config: Annotated[
        list[Path] | None,
        typer.Option(
            "--config",
            "-c",
            metavar="FILE",
            help="The TOML file; else ./netboard.toml if it is there, else the defaults. Given again: one more dyad, "
            "on the port that its file names.",
        ),
    ] = None,
    overrides: Overrides = None,
    autostart: Annotated[
        bool | None,
        typer.Option(
            "--autostart/--no-autostart",
            help="Start each block when all peers are there; usual for a single block, not in a study, where an "
            "operator does (netboard console).",
        ),
    ] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Listen beyond this machine although nothing is encrypted.")
    ] = False,
    study: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Run a session of this study (netboard plan list).")
    ] = None,
    dyad: Dyad = 1,
    session: SessionNumber = 1,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the study's plan.")] = 1,
    blocks: Annotated[int | None, typer.Option(min=1, help="Of a pilot run: only the first blocks.")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="Of a pilot run: at most so many trials in each.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the session was left.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Go on there without asking.")] = False,
) -> None:
    """Run the physics server: it computes the board and decides the trials, of one dyad or of several."""
    files: list[Path | None] = [*(config or (None,))]
    settings = [configuration.load(file, overrides or ()) for file in files]
    if not insecure:
        for one in settings:
            refuse_open_network(one)
    if study is None and resume:
        raise ConfigError("--resume: expected the --study that is resumed: a single block is not")
    if study is not None and len(settings) > 1:
        raise ConfigError(f"--study: found with {len(settings)} files, expected one: each dyad of a study has a server")
    from netboard.services import server as service

    if study is None:
        raise typer.Exit(service.main(settings, autostart=autostart is not False))
    from netboard.services.planned import Wanted

    wanted = Wanted(study, dyad, session, seed, blocks, trials)
    raise typer.Exit(service.study(settings[0], wanted, autostart=autostart is True, resume=resume, yes=yes))


def refuse_open_network(config: Config) -> None:
    """Refuse an address that other machines can reach, where nothing is encrypted.

    Raises
    ------
    ConfigError
        If the server would listen beyond this machine without keys.
    """
    from netboard.keys import encrypted, local

    network = config.network
    if network.transport == "tcp" and not local(network.bind) and not encrypted(network):
        raise ConfigError(
            f'[network] bind: found "{network.bind}", which other machines can reach, with curve = "{network.curve}": '
            'leave that to "auto" and make keys (netboard keys init), or, on a network of your own, start the server '
            "with --insecure"
        )


@app.command(epilog=examples("netboard agent --side left", "netboard agent --side right -c rig.toml"))
def agent(
    side: Annotated[Side, typer.Option(help="The hand this device is for.")],
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Run a haptic agent: one per device; it reads the stylus, renders the force and keeps it safe."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import agent as service

    raise typer.Exit(service.main(settings, side=side))


@app.command(
    epilog=examples(
        "netboard display --station left",
        "netboard display --station right --offscreen --screenshot r.png",
        "netboard display --calibrate --set display.screen=1",
    )
)
def display(
    station: Annotated[Side | None, typer.Option(help="The seat whose view this is.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    screenshot: Screenshot = None,
    after: Annotated[
        float | None,
        typer.Option(min=0, metavar="SECONDS", help="Take the screenshot so long after the first view, and go on."),
    ] = None,
    offscreen: Annotated[bool, typer.Option("--offscreen", help="Draw without a screen.")] = False,
    list_screens: Annotated[
        bool, typer.Option("--list-screens", help="Print the screens of this machine, and show nothing.")
    ] = False,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Measure the pixels of the screen with a bank card.")
    ] = False,
) -> None:
    """Run a participant's display: board, ball, target and one's own stylus."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import display as service

    if list_screens:
        raise typer.Exit(service.list_screens())
    if calibrate:
        raise typer.Exit(service.calibrate(settings))
    if station is None:
        raise ConfigError("--station: not given, expected left or right")
    raise typer.Exit(service.main(settings, station=station, screenshot=screenshot, after=after, offscreen=offscreen))


@app.command(epilog=examples("netboard console", "netboard console -c rig.toml", "netboard console --screenshot c.png"))
def console(
    config: ConfigFile = None,
    overrides: Overrides = None,
    screenshot: Screenshot = None,
    after: Annotated[
        float | None,
        typer.Option(min=0, metavar="SECONDS", help="Take the screenshot so long after the first word, and go on."),
    ] = None,
    offscreen: Annotated[bool, typer.Option("--offscreen", help="Draw without a screen.")] = False,
) -> None:
    """Open the operator's window: see how everything is, open the session, run it, stop it."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import console as service

    raise typer.Exit(service.main(settings, screenshot=screenshot, after=after, offscreen=offscreen))


@app.command(epilog=examples("netboard logger", "netboard logger --set recording.directory=/data --once"))
def logger(
    config: ConfigFile = None,
    overrides: Overrides = None,
    once: Annotated[bool, typer.Option("--once", help="Stop after one session.")] = False,
) -> None:
    """Run the logger: it writes every tick and event to a recording."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import logger as service

    raise typer.Exit(service.main(settings, once=once))


@app.command(epilog=examples("netboard lsl -c rig.toml", "netboard lsl -c b.toml --name pair2"))
def lsl(
    config: ConfigFile = None,
    overrides: Overrides = None,
    name: Annotated[
        str, typer.Option(help="First part of the streams' names; another one for each dyad in the same room.")
    ] = "netboard",
) -> None:
    """Send board, hands, forces and events to the Lab Streaming Layer, for LabRecorder, while sessions run."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import lsl as service

    raise typer.Exit(service.main(settings, name))


@app.command(
    epilog=examples(
        "netboard demo",
        "netboard demo --play left",
        "netboard demo --trials 2 --haptics off --bimanual",
        "netboard demo --study paper --dyad 3 --blocks 4 --trials 5",
    )
)
def demo(
    config: ConfigFile = None,
    overrides: Overrides = None,
    trials: Annotated[
        int | None, typer.Option(min=1, help="Successful trials: 6, or in each block of a study at most so many.")
    ] = None,
    haptics: Annotated[Literal["on", "off"], typer.Option(help="Whether the hands feel the board.")] = "on",
    bimanual: Annotated[bool, typer.Option("--bimanual", help="One simulated person with both hands.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 1,
    directory: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the recording goes.")] = Path("recordings"),
    displays: Annotated[bool, typer.Option("--displays/--no-displays", help="Run the two displays.")] = True,
    play: Annotated[
        Literal["left", "right", "both"] | None,
        typer.Option(
            help="Play a side yourself, with the mouse; the other one is simulated. Both: the mouse moves the left "
            "hand, the up and down keys the right one."
        ),
    ] = None,
    study: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="A session of a study in place of one block, as a pilot run."),
    ] = None,
    dyad: Dyad = 1,
    blocks: Annotated[int | None, typer.Option(min=1, help="Only the first blocks of the study.")] = None,
) -> None:
    """Run a whole session on this machine, with simulated people, or play in it."""
    if play and not displays:
        raise ConfigError(f"--no-displays: found with --play {play}, which needs a window to play in")
    if play in SIDES and bimanual:
        raise ConfigError(f"--bimanual: found with --play {play}, expected --play both: one person moves both hands")
    settings_of = demo_settings(
        trials=trials or 6, haptics=haptics, bimanual=bimanual, seed=seed, directory=directory, play=play
    )
    if study is not None:
        settings_of.append("session.pilot=true")
    settings = configuration.load(config, [*settings_of, *(overrides or ())])
    from netboard.services import demo as service
    from netboard.services.planned import Wanted

    wanted = None if study is None else Wanted(study, dyad, 1, seed, blocks, trials)
    raise typer.Exit(service.main(settings, displays=displays, study=wanted))


def demo_settings(
    *, trials: int, haptics: str, bimanual: bool, seed: int, directory: Path, play: str | None = None
) -> list[str]:
    """Write the demo's own options as settings."""
    played = [side for side in SIDES if play in (side, "both")]
    return [
        f"block.trials={trials}",
        f"block.force={'full' if haptics == 'on' else 'none'}",
        f"block.configuration={'bimanual' if bimanual else 'dyadic'}",
        f"block.seed={seed}",
        f"recording.directory={directory}",
        *(f"agents.{side}.device={MOUSE}" for side in played),
        *(["agents.right.options.input=keys"] if play == "both" else []),
    ]


@app.command(
    epilog=examples(
        "netboard simulate --input stylus.csv --output out.csv",
        "netboard simulate --input stylus.csv --output out.parquet --model lagrangian --set physics.k_h=300 --p0 -0.15",
        "netboard simulate --input stylus.csv --output live.csv --hold ca --method rk4 --dt 0.001",
        "netboard simulate --input hands/ --output results/",
        "netboard simulate --input 'hands/*.csv' --output 'results/{}.parquet' --scene rig.toml --gaps hold",
    )
)
def simulate(
    inputs: Annotated[
        list[str],
        typer.Option(
            "--input",
            "-i",
            metavar="FILE",
            help="Hands: .csv or .parquet with the columns t, z_left, v_left, z_right, v_right (s, m, m/s), at any "
            "rate. A folder or a pattern stands for all its files; may be given again.",
        ),
    ],
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE|FOLDER",
            help="The result: .csv or .parquet with the columns t, z, vz, theta, omega, p, vp, f_left, f_right (SI; "
            "the forces are those of the hands on the board, + = up: the hands feel the opposite). For several inputs "
            "a folder, or a name with {} for that of the input.",
        ),
    ],
    more: Annotated[
        list[str] | None, typer.Argument(metavar="FILE", help="More inputs, so that --input hands/*.csv works.")
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A configuration, of which the table \\[physics] counts; else the paper's."),
    ] = None,
    overrides: Overrides = None,
    model: Annotated[
        Literal["paper", "lagrangian"] | None, typer.Option(help="Short for --set physics.model=...")
    ] = None,
    hold: Annotated[
        Literal["zoh", "cv", "ca", "hermite"],
        typer.Option(
            help="How a hand moves between its samples: hermite, a smooth curve through heights and rates; or what the "
            "live server makes of the last one: it rests (zoh), keeps its rate (cv), or its acceleration too (ca)."
        ),
    ] = "hermite",
    gaps: Annotated[
        Literal["refuse", "hold"],
        typer.Option(
            help="Samples more than 3 times as far apart as usual: refuse the file, or go on across (hermite), or let "
            "the stylus rest where it got to (zoh, cv, ca)."
        ),
    ] = "refuse",
    dt: Annotated[
        float, typer.Option(metavar="S", help="Time from row to row of the result; no step is longer (s).")
    ] = 0.001,
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="auto: as good as exact, in as many steps as the scene needs; or one of the server's (euler, rk4, "
            "etdrk4 ...), one step from each sample or row to the next.",
        ),
    ] = "auto",
    substeps: Annotated[int, typer.Option(min=1, metavar="N", help="At least so many steps in place of one.")] = 1,
    ball: Annotated[Literal["free", "fixed"], typer.Option(help="It rolls, or stays where it is put.")] = "free",
    z0: Annotated[float, typer.Option("--z0", metavar="M", help="Height of the board at the first sample (m).")] = 0.0,
    vz0: Annotated[float, typer.Option("--vz0", metavar="M/S", help="Its rate (m/s).")] = 0.0,
    theta0: Annotated[float, typer.Option("--theta0", metavar="RAD", help="Tilt, + = right end up (rad).")] = 0.0,
    omega0: Annotated[float, typer.Option("--omega0", metavar="RAD/S", help="Its rate (rad/s).")] = 0.0,
    p0: Annotated[
        list[str] | None,
        typer.Option("--p0", metavar="M", help="Ball along the board, + = right (m); for each ball, as 0.1,-0.1."),
    ] = None,
    v0: Annotated[list[str] | None, typer.Option("--v0", metavar="M/S", help="Its rate (m/s); likewise.")] = None,
    energy: Annotated[
        bool,
        typer.Option("--energy", help="Add columns: energies (E_...) and work since the first row (W_...), in J."),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite results that are there.")] = False,
) -> None:
    """Move a scene by the hands in a file, offline and as exactly as the samples allow."""
    if energy and hold != "hermite":
        raise ConfigError(f"--energy: found --hold {hold}, expected hermite: otherwise the hands jump from row to row")
    from netboard.services import simulate as service

    settings = service.load_scene(scene, [*(overrides or ()), *([f"physics.model={model}"] if model else ())])
    wishes = service.Wishes(
        hold=hold,
        gaps=gaps,
        method=method,
        dt=dt,
        substeps=substeps,
        ball=ball,
        board0=(z0, vz0, theta0, omega0),
        p0=numbers("--p0", p0),
        v0=numbers("--v0", v0),
        energy=energy,
    )
    raise typer.Exit(service.main([*inputs, *(more or ())], output, settings, wishes, force=force))


def numbers(option: str, words: list[str] | None) -> tuple[float, ...]:
    """Read the numbers of an option that may be given again, or with commas."""
    try:
        return tuple(float(word) for given in words or () for word in given.split(","))
    except ValueError:
        raise ConfigError(f"{option}: found {' '.join(words or ())}, expected numbers, with commas between") from None


@app.command(epilog=examples("netboard status", "netboard status -c rig.toml --watch", "netboard status --json"))
def status(
    config: ConfigFile = None,
    overrides: Overrides = None,
    watch: Annotated[bool, typer.Option("--watch", help="Go on showing it until Ctrl-C.")] = False,
    json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """Show a running session and every peer of it: link, round trip, clock, rate, losses, version."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import status as service

    raise typer.Exit(service.main(settings, watch=watch, as_json=json))


@app.command(epilog=examples("netboard stop", "netboard stop --guard -c rig.toml", "netboard stop --release"))
def stop(
    config: ConfigFile = None,
    overrides: Overrides = None,
    release: Annotated[bool, typer.Option("--release", help="End the stop: devices may be armed again.")] = False,
    guard: Annotated[bool, typer.Option("--guard", help="Stand by, and stop when any key is pressed.")] = False,
) -> None:
    """Emergency stop: no device has a force any more, until it is released.

    With --guard it is connected already, and acts within a millisecond; without, it has to start first.
    """
    if release and guard:
        raise ConfigError("--release and --guard: expected one of them, for they are opposites")
    settings = configuration.load(config, overrides or ())
    from netboard.services import control as service

    raise typer.Exit(service.emergency(settings, release=release, guard=guard))


Deed = Literal[
    "start",
    "pause",
    "pause_after_trial",
    "resume",
    "abort",
    "repeat",
    "veto",
    "skip",
    "stop",
    "stop_after_block",
    "next",
    "end",
    "open",
    "arm",
    "disarm",
    "note",
    "take",
    "play",
    "seek",
    "speed",
    "loop",
    "step",
    "previous",
]


@app.command(
    epilog=examples(
        "netboard control start",
        "netboard control pause_after_trial -c rig.toml --json",
        """netboard control open '{"participant_a": "P07", "participant_b": "P08", "consent": true}'""",
        "netboard control note 'the left participant sneezed'",
        "netboard control start --until finished --seconds 900",
        "netboard control seek trial 5",
        "netboard control step back 10",
    )
)
def control(
    command: Annotated[
        Deed,
        typer.Argument(
            help="abort gives up the attempt, which begins anew; skip counts the trial as done; repeat adds a trial at "
            "the end of the block, and veto takes that back; stop ends the block; next goes on to the next one; end "
            "ends the session and the server; open takes a form as JSON; take makes this the commander. A replay knows "
            "play, pause, seek 12.5 (or trial 5, tick 900), speed 0.5, loop (on, off, trial 5, or from and to), step "
            "(ticks), next and previous (trial, or another mark), and end."
        ),
    ],
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ARGUMENT...]", help="What the command needs to know: a form, a note, a trial."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    take: Annotated[bool, typer.Option("--take", help="Command even if a console does: take over.")] = False,
    until: Annotated[
        Literal["idle", "levelling", "running", "holding", "paused", "finished"] | None,
        typer.Option(metavar="PHASE", help="Wait then until the trial is in this phase; exit code 1 if it is not."),
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="At most so long.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Answer and status as one line of JSON.")] = False,
) -> None:
    """Tell a running server what to do, as the console does: for scripts."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import control as service

    raise typer.Exit(
        service.command(
            settings, command, " ".join(arguments or ()), take=take, until=until, seconds=seconds, as_json=json
        )
    )


@app.command(epilog=examples("netboard doctor -c rig.toml", "netboard doctor --quick --json report.json"))
def doctor(
    config: ConfigFile = None,
    overrides: Overrides = None,
    quick: Annotated[bool, typer.Option("--quick", help="In seconds instead of half a minute.")] = False,
    json: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the report there too.")] = None,
) -> None:
    """Check whether this machine is fit for a session, and say what to do where it is not."""
    settings = configuration.load(config, overrides or ())
    from netboard.services import doctor as service

    raise typer.Exit(service.main(settings, quick=quick, json=json))


@app.command(
    epilog=examples(
        "netboard up --server /etc/netboard/netboard.toml",
        "netboard up --station left /etc/netboard/netboard.toml",
        "netboard up --server --station both",
    )
)
def up(
    config: Annotated[
        Path | None,
        typer.Argument(metavar="CONFIG", help="The TOML file; else ./netboard.toml if it is there, else the defaults."),
    ] = None,
    station: Annotated[
        Literal["left", "right", "both"] | None, typer.Option(help="The seat here: its agent and its display.")
    ] = None,
    server: Annotated[bool, typer.Option("--server", help="The server here, and the logger.")] = False,
    overrides: Overrides = None,
    autostart: Annotated[bool, typer.Option(help="Start the block when all peers are there.")] = True,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Listen beyond this machine although nothing is encrypted.")
    ] = False,
) -> None:
    """Start all that belongs on this machine, watch it, and stop it in order on Ctrl-C."""
    configuration.load(config, overrides or ())
    from netboard.services import up as service

    wanted = service.processes(
        config, overrides or (), server=server, station=station, autostart=autostart, insecure=insecure
    )
    raise typer.Exit(service.main(wanted))


@config_app.command(epilog=examples("netboard config check -c rig.toml"))
def check(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """Check the configuration and list everything that is wrong with it."""
    typer.echo(configuration.check(config, overrides or ()))


@config_app.command(epilog=examples("netboard config show", "netboard config show --set block.trials=6"))
def show(config: ConfigFile = None, overrides: Overrides = None) -> None:
    """Show the configuration in full, as it goes into a recording."""
    typer.echo(configuration.show(config, overrides or ()), nl=False)


@config_app.command(epilog=examples("netboard config init", "netboard config init rig.toml"))
def init(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")] = configuration.DEFAULT_FILE,
) -> None:
    """Write a commented file with every setting, its default, unit and limits."""
    typer.echo(configuration.init(file))


recordings.add_to(app)


def main() -> None:
    """Run the command."""
    app()


if __name__ == "__main__":
    main()
