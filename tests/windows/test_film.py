"""A film shows what both participants saw, each with the own stylus only, from one time to another."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from made_recordings import loaded_recording, two_trials
from netboard.base.errors import ConfigError, NetboardError


@pytest.mark.parametrize("kind", ["webp", "gif", "png"])
def test_film_has_a_frame_for_each_twentieth_of_a_second(kind: str, app: object, tmp_path: Path) -> None:
    from netboard.windows.replay.film import GAP, HEIGHT, WIDTH, write_film

    path = tmp_path / "films" / f"trial.{kind}"
    write_film(loaded_recording(two_trials()), path, 1.0, 2.0, 2.0)
    with Image.open(path) as film:
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]
        assert film.size == (2 * WIDTH + GAP, HEIGHT)
    assert 1 < len(frames) <= 10  # at twice the speed; equal frames may be joined
    left, right = frames[0][:, :WIDTH], frames[0][:, WIDTH + GAP :]
    assert (left != right).any()
    assert len(np.unique(left.reshape(-1, 3), axis=0)) > 2


def test_film_refuses_other_types_times_outside_and_existing_files(app: object, tmp_path: Path) -> None:
    from netboard.windows.replay.film import write_film

    recording = loaded_recording(two_trials())
    with pytest.raises(ConfigError, match=r"--film: found trial.mp4, expected a name that ends with"):
        write_film(recording, tmp_path / "trial.mp4", 0.0, None, 1.0)
    with pytest.raises(ConfigError, match="--until: found 1, expected a time after 2 s"):
        write_film(recording, tmp_path / "trial.gif", 2.0, 1.0, 1.0)
    with pytest.raises(ConfigError, match="--at: found 1000000, expected at most"):
        write_film(recording, tmp_path / "trial.gif", 1e6, None, 1.0)
    with pytest.raises(ConfigError, match="s of film; expected at most 60 s"):
        write_film(recording, tmp_path / "trial.gif", 0.0, 4.0, 0.05)
    (tmp_path / "trial.gif").touch()
    with pytest.raises(NetboardError, match="already exists"):
        write_film(recording, tmp_path / "trial.gif", 0.0, 1.0, 1.0)
