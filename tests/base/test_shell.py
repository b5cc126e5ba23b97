"""Advised commands are read by a shell as they are meant."""

import shutil
import subprocess
from pathlib import Path

import pytest

from netboard.base.errors import ConfigError
from netboard.base.terminal.shell import shell_command
from netboard.recording.files.locate import recovery_advice
from netboard.services import loading


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash to read the command")
@pytest.mark.parametrize("word", ["plain", "two words", "it's", "a\u202eb", "new\nline", "back\\slash\u200f'", "ünï"])
def test_shell_reads_a_quoted_command_correctly(word: str) -> None:
    done = subprocess.run(["bash", "-c", shell_command("printf", "%s", word)], capture_output=True, check=True)
    assert done.stdout.decode("utf-8") == word


def test_messages_quote_the_paths_of_advised_commands() -> None:
    assert recovery_advice(Path("my file.mcap")) == "run: netboard recover 'my file.mcap'"
    with pytest.raises(ConfigError, match=r"netboard config init 'my rig.toml'"):
        loading.load(Path("my rig.toml"))
    with pytest.raises(ConfigError, match=r"netboard analyse --template > 'my readings.toml'"):
        loading.load_readings(Path("my readings.toml"), None)
