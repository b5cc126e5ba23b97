"""Checks of the operating system, where settings can delay a loop that must wake every millisecond, and of software.

All settings are read from /proc, /sys and /dev below a root that a test may choose. A missing file means that the
system does not have that setting.
"""

import platform
import sys
from collections.abc import Callable, Collection, Iterator
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryFile

from netboard.base import kernel_cache
from netboard.base.finding import Colour, Finding, graded, text_of
from netboard.base.process.display_server import PLATFORM, asked_offscreen, no_screen, why_no_qt
from netboard.base.process.realtime import OFF, OK, PLACES, cpu_set
from netboard.network.transport import sockets

ROOT = Path("/")
NOT_OFFERED = "not offered here"
STEADY_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "timebase")
"""Clock sources that are read in well under a microsecond."""

LIGHT_SLEEP_US = 20
"""Wake-up time from a core's deepest sleep that is still acceptable [us]."""

LIMITS = "install deploy/limits.d/netboard.conf, join the group netboard, log in again"

MIN_RUNTIME = 0.8
"""Smallest share of a core that real-time loops should be allowed [1]."""

CACHE_BYTES = 10_000_000
"""Size of the compiled kernels of a session [1]."""


def throttle(root: Path = ROOT) -> Finding:
    """Check how much of a core real-time loops may take.

    It should be less than all, so that a hung loop does not freeze the machine.
    """
    name = "real-time throttle"
    kernel = root / "proc/sys/kernel"
    runtime, period = text_of(kernel / "sched_rt_runtime_us"), text_of(kernel / "sched_rt_period_us")
    if not runtime or not period:
        return Finding(name, "green", NOT_OFFERED)
    found = f"{runtime} of {period} us"
    if int(runtime) < 0:
        return Finding(
            name, "yellow", "off", "a loop that hangs can freeze the machine: sysctl kernel.sched_rt_runtime_us=950000"
        )
    if int(runtime) < MIN_RUNTIME * int(period):
        return Finding(name, "red", found, "too little for a loop: sysctl kernel.sched_rt_runtime_us=950000")
    return Finding(name, "green", found)


def governor(root: Path = ROOT) -> Finding:
    """Check whether cores change their clock rate, which slows down a loop that sleeps most of the time."""
    name = "CPU governor"
    found = {text_of(file) for file in (root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")}
    if not found:
        return Finding(name, "green", "the clock rate is fixed, or the host controls it")
    if found == {"performance"}:
        return Finding(name, "green", "performance")
    return Finding(name, "yellow", ", ".join(sorted(found)), "cpupower frequency-set --governor performance")


def preemption(root: Path = ROOT) -> Finding:
    """Check whether the kernel can be preempted when a loop is due."""
    name = "kernel preemption"
    version = text_of(root / "proc/version")
    if not version:
        return Finding(name, "green", NOT_OFFERED)
    if text_of(root / "sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return Finding(name, "green", "PREEMPT_RT")
    _, _, rest = text_of(root / "sys/kernel/debug/sched/preempt").partition("(")
    chosen, _, _ = rest.partition(")")
    options = [word.partition("=")[2] for word in text_of(root / "proc/cmdline").split() if word.startswith("preempt=")]
    model = chosen or (options[-1] if options else "")
    if model in {"none", "voluntary"} or "PREEMPT" not in version:
        return Finding(name, "yellow", model or "none", "boot with preempt=full, or a PREEMPT_RT kernel")
    return Finding(name, "green", model or ("chosen at boot" if "PREEMPT_DYNAMIC" in version else "full"))


def virtual_machine(root: Path = ROOT) -> Finding:
    """Check whether a host may take the cores away from this machine, which no setting in it can prevent."""
    guest = "hypervisor" in text_of(root / "proc/cpuinfo").split()
    advice = "run server and agents on physical machines, or pin its cores on the host"
    return graded("virtual machine", not guest, "yes" if guest else "no", advice)


def cores(have: Collection[int]) -> Finding:
    """Check whether server and agents can have a core each, and the rest of the system another."""
    advice = f"a server with both agents needs {len(PLACES) + 1}: use a larger machine, or one machine for each station"
    return graded("cores", len(have) > len(PLACES), f"{len(have)}", advice)


def isolation(server: str, have: Collection[int], root: Path = ROOT) -> Finding:
    """Check whether the server has a core on which the kernel places nothing else; ``server``: its CPUs."""
    name = "isolated cores"
    isolated = text_of(root / "sys/devices/system/cpu/isolated")
    if not isolated:
        if len(have) <= len(PLACES):
            return Finding(name, "green", "none; there are too few cores to isolate one")
        return Finding(name, "yellow", "none", "boot with isolcpus=, and name these cores in [realtime] server_cpus")
    if server and cpu_set(server) <= cpu_set(isolated):
        return Finding(name, "green", f"{isolated}; the server is on {server}")
    return Finding(name, "yellow", f"{isolated}, but not the server's", f'[realtime] server_cpus = "{isolated}"')


def core_sleep(granted: bool, root: Path = ROOT) -> Finding:
    """Check how long a core takes to wake; `granted` says that netboard prevents deep sleep while it runs."""
    states = (root / "sys/devices/system/cpu/cpu0/cpuidle").glob("state*/latency")
    deepest = max((int(text_of(state) or 0) for state in states), default=0)
    found = f"wakes within {deepest} us" + (
        ", 2 us while netboard runs" if granted and deepest > LIGHT_SLEEP_US else ""
    )
    advice = "let the group netboard write /dev/cpu_dma_latency (deploy/udev/70-netboard.rules)"
    good = deepest <= LIGHT_SLEEP_US or granted
    return graded("sleep of cores", good, found, advice, {"latency_us": deepest})


def clock_source(root: Path = ROOT) -> Finding:
    """Check which clock source the kernel uses."""
    found = text_of(root / "sys/devices/system/clocksource/clocksource0/current_clocksource") or NOT_OFFERED
    advice = "slow to read; boot with clocksource=tsc if the processor's time stamp counter is reliable"
    return graded("clock source", found in (NOT_OFFERED, *STEADY_CLOCKS), found, advice)


def scheduling(result: str) -> Finding:
    """Check whether the loops get real-time scheduling; `result` is the result of the request."""
    return _requested("real-time scheduling", "scheduling", result, "red")


def memory(result: str) -> Finding:
    """Check whether memory is locked against paging; `result` is the result of the request."""
    return _requested("locked memory", "lock_memory", result, "yellow")


def _requested(name: str, key: str, result: str, refused: Colour) -> Finding:
    """Judge the result of a request for one of the keys of ``[realtime]``."""
    if result == OK:
        return Finding(name, "green", "granted")
    if result == OFF:
        return Finding(name, "yellow", "not asked for", f"[realtime] {key} = true")
    if sys.platform != "linux":
        return Finding(name, "yellow", result, "run server and agents on Linux")
    return Finding(name, refused, f"refused: {result}", LIMITS)


def cpus(wanted: str, result: str) -> Finding:
    """Check whether the server may run on its dedicated CPUs."""
    if result == OK:
        return Finding("server's CPUs", "green", wanted)
    advice = "name CPUs of the server's machine in [realtime] server_cpus"
    return Finding("server's CPUs", "yellow", f"{wanted}: {result}", advice)


def versions() -> Finding:
    """Report the versions of Python and the libraries."""
    python = f"{platform.python_implementation()} {platform.python_version()}"
    libraries = [f"{name} {version(name)}" for name in ("netboard", "numba", "numpy", "pyzmq")]
    return Finding("software", "green", ", ".join([python, *libraries, sockets.library()]))


def kernels() -> Finding:
    """Check whether the cache of compiled kernels is sound, and whether it can take more."""
    name, folder = "compiled kernels", kernel_cache.folder()
    count, size, damaged = kernel_cache.examine()
    found = f"{count} in {folder}, {size / 1e6:.1f} MB"
    if damaged:
        found = f"{len(damaged)} of {count} in {folder} are damaged: {damaged[0]}"
        advice = f"they are compiled again when used, which takes minutes; delete {folder}, and check the disk"
        return Finding(name, "yellow", found, f"{advice}: netboard session rehearse pilot fills it again")
    try:
        with TemporaryFile(dir=folder) as file:
            file.write(bytes(CACHE_BYTES))
    except OSError as error:
        advice = "each process compiles what is missing, which takes minutes: make room, or set NUMBA_CACHE_DIR"
        return Finding(name, "yellow", f"{found}; no more can be kept: {error.strerror}", advice)
    return Finding(name, "green", found)


def windows(why_not: Callable[[], str] = why_no_qt) -> Iterator[Finding]:
    """Check whether windows can run here, and whether somebody sees them."""
    why = why_not()
    advice = "displays and console need it: deploy/setup.sh run"
    yield graded("Qt", not why, f"cannot be loaded: {why}" if why else "loads", advice)
    if not why:
        yield _screen()


def _screen() -> Finding:
    """Check whether somebody sees the windows of this machine."""
    name = "screen"
    if asked := asked_offscreen():
        found = f"{asked}: windows are drawn off screen, where nobody sees them"
        return Finding(name, "yellow", found, f"at a station or with a console: unset {PLATFORM}")
    if found_none := no_screen():
        advice = f"a display or a console cannot run here: {found_none.advice}"
        return Finding(name, "yellow", found_none.why, advice)
    return Finding(name, "green", "windows open on it")
