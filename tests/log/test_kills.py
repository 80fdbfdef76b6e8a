"""A recording whose process is killed, as in `benchmarks/recordings --kills`."""

from pathlib import Path

import pytest
from recordings.kills import Scene, kill_one, make_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return make_scene()


@pytest.mark.parametrize("lifetime", [0.05, 0.3, 1.0])
def test_a_killed_recording_is_readable_without_gaps(
    tmp_path: Path, lifetime: float, scene: Scene
) -> None:
    loss = kill_one(tmp_path, lifetime, scene)
    assert loss.is_readable
    assert loss.holes == 0
    assert loss.ticks >= 0
