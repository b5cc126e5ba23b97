"""A machine whose processes are entries of a table: a test lets them end."""

from netboard.network.protocol.station import ProcessStatus


class FakeMachine:
    """Starts what it is asked to; a process that was asked to stop ends with `let_stop`."""

    def __init__(self) -> None:
        self.trouble = ""
        self.processes: dict[str, ProcessStatus] = {}
        self.started: list[str] = []
        self.asked: list[str] = []
        self.logs: dict[str, str] = {}

    def start(self, name: str) -> None:
        self.started.append(name)
        self.processes[name] = ProcessStatus(name, "running", None, len(self.started), 0.0, 0)

    def stop(self, name: str) -> None:
        if self.processes[name].phase == "running":
            self.asked.append(name)
            self.processes[name] = self.processes[name]._replace(phase="stopping")

    def hurry(self) -> None:
        self.let_stop()

    def poll(self) -> None:
        pass

    def tail(self, name: str) -> str:
        return self.logs.get(name, "")

    def end(self, name: str, code: int, log: str = "") -> None:
        """Let a process end by itself."""
        self.logs[name] = log
        self.processes[name] = self.processes[name]._replace(phase="ended", code=code)

    def let_stop(self) -> None:
        """Let the processes end that were asked to."""
        for name, status in self.processes.items():
            if status.phase == "stopping":
                self.processes[name] = status._replace(phase="stopped", code=0)
