"""A launcher whose processes run Python scripts in place of netboard's commands."""

import subprocess
import sys
import time

from netboard.nodes.operator.launcher import Launcher

IGNORES_STOP = """
import signal, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("on", flush=True)
time.sleep(60)
"""

SLOW_STOP = """
import signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: (time.sleep(0.5), print("done", flush=True), sys.exit(0)))
print("on", flush=True)
time.sleep(60)
"""


class ScriptLauncher(Launcher):
    """Each process has one argument, the script; it is running when it has printed "on"."""

    def start(self, name: str, *arguments: str) -> None:
        (script,) = arguments
        path = self.log_of(name)
        assert path is not None
        with path.open("ab") as output:
            self._running[name] = subprocess.Popen([sys.executable, "-c", script], stdout=output)
        while "on" not in path.read_text():
            time.sleep(0.01)
