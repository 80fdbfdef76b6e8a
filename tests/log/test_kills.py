"""A recording whose process is killed, as in `benchmarks/recordings --kills`."""

from pathlib import Path

import pytest
from recordings import kills
from recordings.kills import LOST_AT_MOST, Loss, Scene, kill_one, loss_of, make_scene


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


def test_a_log_that_cannot_be_read_lost_all(
    tmp_path: Path, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    log_file = tmp_path / "damaged.mcap"
    log_file.write_bytes(b"no log")
    lost = loss_of(log_file, 2.0)
    assert (lost.is_readable, lost.ticks) == (False, 2.0)

    def fail(path: Path) -> None:
        raise AssertionError("a message of rosbags")

    monkeypatch.setattr(kills, "_read_with_rosbags", fail)
    assert not kill_one(tmp_path, 0.05, scene).is_readable


@pytest.mark.parametrize(
    ("ticks", "holes", "is_readable", "is_failure"),
    [
        (LOST_AT_MOST, 0, True, False),
        (LOST_AT_MOST + 0.01, 0, True, True),
        (0.0, 1, True, True),
        (0.0, 0, False, True),
    ],
)
def test_a_recording_fails_its_goal_by(
    ticks: float, holes: int, is_readable: bool, is_failure: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    loss = Loss(2.0, ticks, 0.0, holes, is_readable)
    monkeypatch.setattr(kills, "kill_one", lambda *_: loss)
    monkeypatch.setattr(kills, "make_scene", lambda: None)
    assert kills.kills(3)["failed"] == 3 * is_failure
