"""What a replay shows now: a recording, and the position in it."""

import uuid
from dataclasses import dataclass, field

from netboard.base.clock import now_ns
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.position import Playback


@dataclass
class ReplayState:
    """A recording and its playback."""

    reel: LoadedRecording
    playback: Playback
    # Id of this run; not that of the recording, because numbering restarts.
    session: str = field(default_factory=lambda: uuid.uuid4().hex)

    @property
    def index(self) -> int:
        """The row that is shown now [1]."""
        return self.reel.at(self.playback.at(now_ns() * 1e-9))
