"""Functions of the user's that reuse their arrays, are slow, or call the loop."""

import time
from collections.abc import Callable
from itertools import count

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope import HysteresisReduction, Report, axes
from tautscope.config import Config
from tautscope.errors import SignalError
from tautscope.loop.actuators import Actuators
from tautscope.loop.kinematics import own_kinematics

Floats = NDArray[np.float64]
Measure = Callable[[HysteresisReduction], Report]
ROBOT = axes(2, width_limit=1.0, range=[-2, 2])
HERE, EYE = "test_user_functions", np.eye(2)


class Fresh:
    """A tip and a point that move with the state."""

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        return np.array([0.03 * q[0], 0.05 * q[1], 0.0]), np.eye(3)

    def points(self, q: Floats) -> Floats:
        return np.array([[300.0, 5.0] @ q, [4.0, 250.0] @ q]).reshape(1, 2)


class Reusing(Fresh):
    """The same in arrays that the next call changes."""

    def __init__(self) -> None:
        self._position, self._rotation, self._pixels = (
            np.empty(3),
            np.empty((3, 3)),
            np.empty((1, 2)),
        )

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        self._position[:], self._rotation[:] = super().tip(q)
        return self._position, self._rotation

    def points(self, q: Floats) -> Floats:
        self._pixels[:] = super().points(q)
        return self._pixels


class Slow(Fresh):
    """A tip that takes some milliseconds."""

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        time.sleep(4e-3)
        return super().tip(q)


def own(kind: type) -> Config:
    return ROBOT.replace(**{"kinematics.kind": f"{HERE}:{kind.__name__}"})


def by_pose(loop: HysteresisReduction) -> Report:
    return loop.on_pose([1e-3, 2e-3, 0.0], 0.005)


def by_whole_pose(loop: HysteresisReduction) -> Report:
    return loop.on_pose([1e-3, 2e-3, 0.0], 0.005, np.eye(3))


def by_points(loop: HysteresisReduction) -> Report:
    return loop.on_points([[5.0, 4.0]], 0.005)


def moved(config: Config) -> HysteresisReduction:
    loop = HysteresisReduction(config)
    for tick in range(2):
        loop.step([0.0, 0.0], 0.005 * tick)
    return loop


def assert_equal(one: Report, other: Report) -> None:
    for name in ("status", "innovation", "observable", "state_estimate", "predicted_features"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.observable.all()


@pytest.mark.parametrize("measure", [by_pose, by_whole_pose, by_points])
def test_kinematics_may_reuse_their_arrays(measure: Measure) -> None:
    assert_equal(measure(moved(own(Reusing))), measure(moved(own(Fresh))))


def test_tips_of_several_states_differ_although_the_arrays_are_reused() -> None:
    kinematics = own_kinematics(own(Reusing))
    assert kinematics is not None
    places = [kinematics.tip(np.array(q))[0] for q in ([0.0, 1.0], [1.0, 0.0])]
    np.testing.assert_array_equal(places, [[0.0, 0.05, 0.0], [0.03, 0.0, 0.0]])


def test_a_model_may_reuse_its_array() -> None:
    buffer, matrix = np.empty(2), np.array([[30.0, 5.0], [-4.0, 25.0]])

    def reusing(q: Floats) -> Floats:
        return np.matmul(matrix, q, out=buffer)

    found, expected = (
        moved(ROBOT).on_measurement([0.5, 0.3], 0.005, 2.5e-3 * EYE, predict)
        for predict in (reusing, lambda q: matrix @ q)
    )
    assert_equal(found, expected)


_motors = np.empty(2)


def reusing_map(dofs: Floats) -> Floats:
    """Motors in one array; the degrees of freedom are changed."""
    dofs *= [2.0, 3.0]
    _motors[:] = dofs
    return _motors


def changing_map(dofs: Floats) -> Floats:
    """The degrees of freedom themselves, changed."""
    dofs *= [2.0, 3.0]
    return dofs


@pytest.mark.parametrize("kind", [reusing_map, changing_map])
def test_a_map_of_motors_may_reuse_its_array(kind: Callable[..., Floats]) -> None:
    limits = [[-2.0, 2.0], [-9.0, 9.0]]
    by_map = {"map": f"{HERE}:{kind.__name__}", "limits": limits}
    by_matrix = {"matrix": [[2.0, 0.0], [0.0, 3.0]], "limits": limits}
    start, command = np.array([0.5, 0.0]), np.array([1.5, 2.0])
    reached = []
    for section in (by_map, by_matrix):
        actuators = Actuators(ROBOT.replace(actuators=section))
        np.testing.assert_array_equal(actuators.motors(command), [3.0, 6.0])
        reached.append(actuators.limited(start, command))
    np.testing.assert_allclose(*reached)
    np.testing.assert_array_equal(command, [1.5, 2.0])


def test_a_ragged_map_is_named() -> None:
    actuators = Actuators(ROBOT.replace(actuators={"map": f"{HERE}:ragged"}))
    with pytest.raises(SignalError, match=r"^actuators\.map: got \[\[1\], \[1, 2\]\]"):
        actuators.motors([0.0, 0.0])


def ragged(_: Floats) -> object:
    return [[1], [1, 2]]


def test_the_log_names_a_slow_model_its_calls_and_the_remedy(
    caplog: pytest.LogCaptureFixture,
) -> None:
    calls = [0]

    def predict(q: Floats) -> Floats:
        calls[-1] += 1
        time.sleep(4e-3)
        return q

    loop = moved(ROBOT)
    for tick in range(3):
        loop.on_measurement([0.0, 0.0], 0.005 + 1e-4 * tick, EYE, predict)
        calls.append(0)
    (line,) = (each for each in caplog.messages if "predict(q)" in each)
    for part in (f"{calls[0]} calls of predict(q)", "safety.stall", "jacobian", "step waits"):
        assert part in line, line


def test_the_log_names_a_slow_tip(caplog: pytest.LogCaptureFixture) -> None:
    by_pose(moved(own(Slow)))
    assert "make tip(q) faster" in caplog.text


def test_a_tip_measured_as_it_is_has_no_model_to_be_slow(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautscope.loop.measurement.perf_counter", count().__next__)
    moved(ROBOT).on_tip([0.0, 0.0], 0.005)
    assert not caplog.messages
    by_pose(moved(own(Fresh)))
    assert "tip(q)" in caplog.text


@pytest.mark.parametrize("name", ["predicted_state", "delta_plus", "supervision"])
def test_a_model_cannot_ask_the_loop(name: str) -> None:
    loop = moved(ROBOT)
    with pytest.raises(SignalError, match=rf"^{name}: got 'a call in predict.*outside of them"):
        loop.on_measurement([0.0, 0.0], 0.005, EYE, lambda _: getattr(loop, name))
    report = loop.on_measurement([0.0, 0.0], 0.005, 1e-4 * EYE, lambda q: q)
    assert report.status == "ok"


def test_a_map_of_motors_cannot_ask_the_loop() -> None:
    document = {"map": f"{HERE}:asking_map", "limits": [[-1, 1]] * 2}
    loop = HysteresisReduction(ROBOT.replace(actuators=document))
    _asked.append(loop)
    with pytest.raises(SignalError, match=r"^reference: got 'a call in .*actuators\.map'"):
        loop.step([0.0, 0.0])
    _asked.clear()
    np.testing.assert_array_equal(loop.step([0.0, 0.0]), [0.0, 0.0])


_asked: list[HysteresisReduction] = []


def asking_map(dofs: Floats) -> Floats:
    return _asked[0].reference if _asked else dofs
