"""The search for mechanical stops finds them, at low torque, and restores a forgotten turn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from servo_settings import AXES, MODELS, servos_document
from tautscope.bench.servos import SimulatedServos
from tautscope.cli import main
from tautscope.config import Config, dump_config, from_document, load_config
from tautscope.dof import Dof
from tautscope.errors import EMERGENCY_STOP, CalibrationError, FollowingError
from tautscope.hardware import stops as stops_module
from tautscope.hardware.drives import open_drives
from tautscope.hardware.stops import find_stops

LOWER, UPPER = -0.011, 0.062  # m, of insertion: 1.8 turns
COUNT = 1 / AXES["insertion"]["counts_per_unit"]


@contextmanager
def between_stops(
    config: Config, at: float, stops: tuple[float, float] = (LOWER, UPPER)
) -> Iterator[SimulatedServos]:
    """Servos whose motor of insertion is between stops; positions are those of the mechanism."""

    def plant(demand: np.ndarray) -> np.ndarray:
        return np.array([np.clip(demand[0], *stops), *demand[1:]])

    actual = config.replace(**{"drives.insertion.stops": None}).drives
    assert actual is not None
    with SimulatedServos(actual, plant, start=np.array([at, 0.0, 0.5])) as servos:
        yield servos


def rig(protocol: str, folder: Path, **insertion: Any) -> Config:
    axis = AXES["insertion"] | {"model": MODELS[protocol]} | insertion
    drives = servos_document(protocol, folder, insertion=axis, cycle=0.01, reply_timeout=0.009)
    return from_document({"control": {"period": 0.01}, "drives": drives})


def test_stops_are_found_and_a_forgotten_turn_is_restored(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = rig("dynamixel", tmp_path, travel=[-0.02, 0.08], speed_limit=0.5)
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    command = ["calibrate", "stops", "insertion", "--config", str(file), "--yes", "--write"]
    with between_stops(config, 0.02) as servos:
        assert main(command) == 0
        assert abs(servos.servos[0].shaft * COUNT - 0.02) < 2e-3  # back where it was
    found = load_config(file).drives
    assert found is not None
    assert found.insertion.stops == pytest.approx((LOWER, UPPER), abs=2 * COUNT)
    assert LOWER < found.insertion.travel[0] < found.insertion.travel[1] < UPPER

    # 0.05 m is in the second turn, which a restarted servo calls the first.
    with between_stops(config, 0.05) as servos:
        with open_drives(found) as drives:
            assert drives.start()[0] == pytest.approx(0.05 - 4096 * COUNT, abs=COUNT)
        assert main(command) == 0
        restored = load_config(file).drives
        assert restored is not None
        with open_drives(restored) as drives:
            assert drives.start()[0] == pytest.approx(servos.servos[0].shaft * COUNT, abs=3 * COUNT)
    assert restored.insertion.home == pytest.approx(4096 * COUNT, abs=3 * COUNT)
    assert "drives.insertion.home = 0.04" in capsys.readouterr().out


def test_stops_of_a_feetech_are_found(tmp_path: Path) -> None:
    config = rig("feetech", tmp_path, travel=[0.018, 0.024], counts_per_unit=3e5)
    with between_stops(config, 0.002, stops=(0.0, 0.004)):
        stops = find_stops(config, Dof.INSERTION, torque=0.5)
    assert (stops.lower, stops.upper) == pytest.approx((0.0, 0.004), abs=2 / 3e5)


def test_stops_are_found_where_the_search_could_go_farther_than_the_servo_counts(
    tmp_path: Path,
) -> None:
    config = rig("feetech", tmp_path, counts_per_unit=2e5, travel=[0.0, 0.06])
    with between_stops(config, 0.01, stops=(0.009, 0.011)):
        stops = find_stops(config, Dof.INSERTION, torque=0.3)
    assert (stops.lower, stops.upper) == pytest.approx((0.009, 0.011), abs=2 / 2e5)


def test_the_bench_has_the_stops_of_its_configuration(tmp_path: Path) -> None:
    at = rig("dynamixel", tmp_path, travel=[0.0, 0.04], stops=[-0.001, 0.041], speed_limit=0.5)
    assert at.drives is not None
    with SimulatedServos(at.drives, start=np.array([0.02, 0.0, 0.5])):
        stops = find_stops(at, Dof.INSERTION, torque=0.3)
    assert (stops.lower, stops.upper) == pytest.approx((-0.001, 0.041), abs=2 * COUNT)


def test_without_a_stop_or_with_other_stops_there_is_no_answer(tmp_path: Path) -> None:
    config = rig("dynamixel", tmp_path, travel=[0.01, 0.012])
    with between_stops(config, 0.02), pytest.raises(CalibrationError, match="no stop on a way"):
        find_stops(config, Dof.INSERTION, torque=0.3)
    other = rig("dynamixel", tmp_path, travel=[0.0, 0.03], stops=[-0.011, 0.04], speed_limit=0.5)
    with (
        between_stops(other, 0.02),
        pytest.raises(CalibrationError, match=r"0\.073 between the stops, and 0\.051 before"),
    ):
        find_stops(other, Dof.INSERTION, torque=0.3).changes(other.drives, Dof.INSERTION)  # type: ignore[arg-type]


def test_only_motors_with_limited_torque_are_driven_against_stops(tmp_path: Path) -> None:
    assert main(["calibrate", "stops", "insertion", "--config", "bench", "--yes"]) == 2


class SoftStop:
    """Drives whose motor of insertion rests at its lower stop; its highest command, and starts."""

    cycle = 0.0

    def __init__(self, node: str) -> None:
        self.node, self.highest, self.starts = node, LOWER, 0

    def __enter__(self) -> SoftStop:
        return self

    def __exit__(self, *failure: object) -> None:
        pass

    def start(self) -> np.ndarray:
        self.starts += 1
        return np.array([LOWER, 0.0, 0.0])

    def exchange(self, command: np.ndarray) -> np.ndarray:
        self.highest = max(self.highest, command[0])
        if not LOWER - 64 * COUNT < command[0] < UPPER:
            raise FollowingError(self.node, "following error", "-")
        return np.array([max(command[0], LOWER), *command[1:]])


@pytest.mark.parametrize("give", [0, 3, 12])
def test_a_motor_pressed_into_its_stop_is_not_driven_through_its_travel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, give: int
) -> None:
    """It rested some counts deeper in it than the search finds it, which moves by 1.4 per cycle."""
    search = stops_module._search_config(rig("feetech", tmp_path), Dof.INSERTION, 0.3)
    reach = UPPER - LOWER
    drives = SoftStop("insertion, servo 1")
    monkeypatch.setattr(stops_module, "open_drives", lambda config: drives)
    begin = LOWER - give * COUNT
    assert stops_module._seek_stop(search, Dof.INSERTION, -1, begin, reach) == pytest.approx(LOWER)
    assert drives.highest == LOWER


class Unconfirmed(SoftStop):
    """Drives that do not confirm their quick stop."""

    def __exit__(self, *failure: object) -> None:
        error = failure[1]
        if isinstance(error, BaseException):
            error.add_note(f"insertion: quick stop is not confirmed. {EMERGENCY_STOP}")


@pytest.mark.parametrize(
    "drives", [SoftStop("insertion_2, servo 4"), Unconfirmed("insertion, servo 1")]
)
def test_after_an_error_of_another_motor_or_an_unconfirmed_stop_nothing_moves(
    drives: SoftStop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = stops_module._search_config(rig("feetech", tmp_path), Dof.INSERTION, 0.3)
    monkeypatch.setattr(stops_module, "open_drives", lambda config: drives)
    with pytest.raises(FollowingError):
        stops_module._seek_stop(search, Dof.INSERTION, -1, LOWER, UPPER - LOWER)
    assert drives.starts == 1
