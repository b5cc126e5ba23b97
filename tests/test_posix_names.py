"""Nothing outside the system's own modules needs POSIX: no name that Windows lacks, and no import that fails there."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}
"""Modules of the standard library that Windows lacks."""

_NAMES = {
    "os": """chroot confstr fchmod fchown fork forkpty fpathconf getegid geteuid getgid getloadavg getpgid getpgrp
        getsid getuid killpg lchown mkfifo mknod nice openpty pidfd_open posix_fadvise posix_fallocate pread preadv
        pwrite pwritev sched_get_priority_max sched_getaffinity sched_getparam sched_getscheduler sched_param
        sched_setaffinity sched_setscheduler sched_yield sendfile set_blocking setgid setpgid setsid setuid statvfs
        sync sysconf tcgetpgrp ttyname uname wait wait3 wait4 waitid writev O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW
        O_NONBLOCK O_SYNC SCHED_FIFO SCHED_OTHER SCHED_RESET_ON_FORK WNOHANG""",
    "signal": """SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGSTOP SIGTSTP SIGTTOU SIGUSR1 SIGUSR2 alarm
        pthread_kill pthread_sigmask set_wakeup_fd setitimer sigwait""",
    "select": "epoll kqueue poll POLLERR POLLHUP POLLIN",
    "socket": "AF_UNIX CMSG_LEN SCM_RIGHTS socket_ipc",
    "time": "CLOCK_MONOTONIC CLOCK_REALTIME clock_getres clock_gettime monotonic_ns pthread_getcpuclockid",
}
NAMES = {module: names.split() for module, names in _NAMES.items()}
"""What Windows lacks in modules that it has; and the clock that counts in steps of 15.6 ms there."""

SYMBOLS = {"clock_gettime", "clock_nanosleep", "mlockall", "nanosleep", "poll", "ppoll", "prctl", "pselect"}
"""Functions of the C library that Windows lacks, by which kernels and ctypes name them."""

SYSTEM = "base/system/"
TRANSPORT = "network/transport/"
ALLOWED = {
    SYSTEM: "both implementations of what POSIX and Windows do in different ways",
    f"{TRANSPORT}local_endpoints.py": "the same, for sockets of one machine",
    f"{TRANSPORT}waiting.py": "the same, for kernels",
    "benchmarks/loop/trigger_box.py": "a stand-in for a serial box on Linux, where the benchmark runs",
}
"""Modules that may name them, and why."""


def files() -> dict[str, Path]:
    """All modules, by their place in the package."""
    package, services = ROOT / "src/netboard", ROOT / "services"
    found = {path.relative_to(package).as_posix(): path for path in package.rglob("*.py")}
    return found | {f"services/{path.relative_to(services).as_posix()}": path for path in services.rglob("*.py")}


def posix_names(text: str) -> list[str]:
    """The names in a text that Windows lacks."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names if alias.name in MODULES]
        elif isinstance(node, ast.ImportFrom):
            found += [node.module or ""] if node.module in MODULES else []
            found += [f"{node.module}.{one.name}" for one in node.names if one.name in NAMES.get(node.module or "", ())]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found += [f"{node.value.id}.{node.attr}"] if node.attr in NAMES.get(node.value.id, ()) else []
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found += ["ipc://"] if node.value.startswith("ipc://") else [node.value] if node.value in SYMBOLS else []
    return found


def test_posix_names_stand_in_the_modules_for_them_only() -> None:
    found = {place: names for place, path in files().items() if (names := posix_names(path.read_text("utf-8")))}
    allowed = {place for place in found if place.startswith(tuple(ALLOWED))}
    assert {place: names for place, names in found.items() if place not in allowed} == {}
    assert {prefix for prefix in ALLOWED if not any(place.startswith(prefix) for place in found)} == set()


@pytest.mark.parametrize(
    "text",
    [
        "import termios",
        "def keys():\n    from fcntl import flock",
        "import os\nos.getuid()",
        "from time import monotonic_ns",
        "import socket\nsocket.socket(socket.AF_UNIX)",
        'where = f"ipc://{folder}"',
        'sleep = c_function("pselect")',
    ],
)
def test_each_kind_of_name_would_be_found(text: str) -> None:
    assert posix_names(text)


IMPORT_ALL = """
import importlib, pkgutil, sys, types
BLOCKED = {blocked!r}

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name in BLOCKED:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

# Libraries decide by the real platform, so they are loaded first, and only netboard's own modules see Windows.
for name in {libraries!r}:
    importlib.import_module(name)
for name in BLOCKED:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Blocked())
sys.path.insert(0, {tests!r})

import ctypes
import windows_stand_in
windows_stand_in.StandInKernel32.LockFileEx = lambda *arguments: 1  # no other process takes part
stand_in = windows_stand_in.StandInKernel32()
libraries = {{"kernel32": stand_in, "ws2_32": windows_stand_in.StandInWinsock(stand_in), "msvcrt": ctypes.CDLL(None)}}
ctypes.WinDLL = lambda name, **options: libraries[name]
load = ctypes.CDLL
ctypes.CDLL = lambda name, *more, **options: libraries.get(name) or load(name, *more, **options)
ctypes.get_last_error = lambda: stand_in.error
sys.modules["msvcrt"] = types.ModuleType("msvcrt")
sys.modules["msvcrt"].get_osfhandle = lambda descriptor: descriptor
sys.platform = "win32"

import netboard, netboard.services
names = [found.name for package in (netboard, netboard.services)
         for found in pkgutil.walk_packages(package.__path__, f"{{package.__name__}}.")]
failed, extras = [], []
for name in sorted(set(names)):
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name in BLOCKED or error.name.startswith(("netboard", "_")):
            failed.append(f"{{name}}: {{error!r}}")
        else:
            extras.append(name)
    except Exception as error:
        failed.append(f"{{name}}: {{error!r}}")
print(len(set(names)) - len(extras), "modules; without a library of an extra:", *extras)
print(*failed, sep="\\n")
sys.exit(bool(failed))
"""

LIBRARIES = (
    *("numba", "scipy.signal", "scipy.stats", "scipy.optimize", "scipy.interpolate", "scipy.linalg"),
    "scipy.special",
    *("zmq", "zmq.utils.z85", "zmq.utils.monitor", "numpy", "pandas", "pyarrow", "pyarrow.parquet", "matplotlib"),
    *(
        "matplotlib.pyplot",
        "matplotlib.figure",
        "statsmodels.api",
        "typer",
        "rich.console",
        "rich.progress",
        "pydantic",
    ),
    *("mcap.reader", "mcap.writer", "msgpack", "zstandard", "lz4.frame", "PySide6.QtWidgets", "PySide6.QtSvg"),
    *("pyqtgraph", "logging.handlers", "asyncio", "multiprocessing", "concurrent.futures.process", "subprocess"),
    *("multiprocessing.connection", "multiprocessing.context", "platform", "tempfile", "mmap", "shutil", "webbrowser"),
    *("gymnasium", "pettingzoo", "dask", "distributed", "emcee", "jinja2", "pynwb", "serial", "usb.core", "websockets"),
    *("importlib.metadata", "tomllib", "pytest", "typer.testing", "statsmodels.formula.api", "sqlite3", "http.server"),
)
"""What netboard imports of others, at any depth that it reaches."""


@pytest.mark.slow
def test_every_module_can_be_imported_where_posix_is_missing(tmp_path: Path) -> None:
    from importlib.util import find_spec

    have = [name for name in LIBRARIES if find_spec(name.partition(".")[0])]
    script = IMPORT_ALL.format(blocked=sorted(MODULES), libraries=have, tests=str(ROOT / "tests"))
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert int(done.stdout.split()[0]) > 500


def test_modules_that_may_name_them_exist() -> None:
    assert all((ROOT / "src/netboard" / prefix).exists() for prefix in ALLOWED)
