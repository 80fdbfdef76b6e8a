"""Motors that are not the degrees of freedom: maps there and back, limits, and the rig behind."""

import logging
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from tautscope import HysteresisReduction, PlayRig, Report, Sample, Tip, axes, run_experiment
from tautscope.config import Config, Sine, from_document
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.actuators import ActuatedRig, Actuators
from tautscope.loop.measurement import Measurement
from tautscope.references import OperatorMotion

Floats = NDArray[np.float64]
PAIRS = [[2e5, 0.0], [-2e5, 0.0], [0.0, 3e-3], [1e5, -3e-3]]
"""Counts of an antagonistic pair, a drum in m, and a tendon that both move."""


def config(**actuators: Any) -> Config:
    names = [("insertion", "m", 0.01), ("bend", "rad", 1.0)]
    dofs = [{"name": name, "unit": unit, "width_limit": width} for name, unit, width in names]
    return from_document({"dof": dofs, "actuators": actuators})


def bent(dofs: Floats) -> Floats:
    """A lever: the motors turn by the sines of the angles, and the second also by the first."""
    return np.array([50 * np.sin(dofs[0]), np.sin(dofs[1]) + dofs[0]])


class Levers:
    def motors(self, dofs: Floats) -> Floats:
        return bent(dofs)

    def dofs(self, motors: Floats) -> Floats:
        first = math.asin(motors[0] / 50)
        return np.array([first, math.asin(motors[1] - first)])


class NoWay:
    pass


class WithArgument:
    def __init__(self, count: int) -> None:
        pass


def test_a_matrix_goes_there_and_back() -> None:
    actuators = Actuators(config(matrix=PAIRS, offsets=[5.0, 5.0, 0.0, 1.0]))
    for q in np.random.default_rng(1).normal(size=(20, 2)) * [0.01, 1.0]:
        motors = actuators.motors(q)
        np.testing.assert_allclose(motors, np.array(PAIRS) @ q + [5.0, 5.0, 0.0, 1.0])
        np.testing.assert_allclose(actuators.dofs(motors), q, rtol=1e-12)


class Waking:
    """Motors whose encoder is not ready in the first tick."""

    is_awake = False

    def motors(self, dofs: Floats) -> Floats:
        if not Waking.is_awake:
            Waking.is_awake = True
            raise RuntimeError
        return dofs

    def dofs(self, motors: Floats) -> Floats:
        return motors


@pytest.mark.parametrize("off", [(), ("monitor",)])
@pytest.mark.parametrize("profile", ["best", "paper"])
def test_a_map_that_fails_in_the_first_tick_moves_nothing_by_itself(
    profile: str, off: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Waking, "is_awake", False)
    waking = config(map="test_actuators:Waking", limits=[[-1, 1], [-1, 1]])
    loop = HysteresisReduction(waking.replace(**{"profile": profile, "safety.off": off}))
    with pytest.raises(RuntimeError):
        loop.step([0.0, 0.0], 0.0)
    for tick in range(1, 4):
        reference = np.full(2, 1e-5 * tick)
        np.testing.assert_allclose(loop.step(reference, 0.005 * tick), reference, atol=1e-3)
    assert loop.supervision.flags == ()


def test_units_of_motors_do_not_weigh() -> None:
    """A motor that reports mm in place of m counts as before, also where the motors disagree."""
    found = []
    for scale in (1.0, 1e3):
        rows = np.array(PAIRS) * [[1.0], [1.0], [scale], [1.0]]
        off = np.array([900.0, -400.0, 2e-4 * scale, 100.0])
        found.append(Actuators(config(matrix=rows)).dofs(rows @ [0.01, 0.5] + off))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
    assert not np.allclose(found[0], [0.01, 0.5], rtol=1e-3)


@pytest.mark.parametrize("kind", ["bent", "Levers"])
def test_a_map_of_your_own(kind: str) -> None:
    actuators = Actuators(config(map=f"test_actuators:{kind}", limits=[[-2, 2], [-1, 1]]))
    q = np.array([0.01, 0.3])
    np.testing.assert_allclose(actuators.motors(q), bent(q))
    back = actuators.dofs(bent(q))
    assert back is None if kind == "bent" else np.allclose(back, q)


def test_a_limited_command_is_the_farthest_within_the_limits() -> None:
    """Along the way to it, and then along each axis, against linear programming."""
    rows = np.array([[2.0, 0.0], [-2.0, 0.0], [0.0, 3.0], [1.0, -3.0]])
    limits = np.array([[-2.0, 2.0]] * 3 + [[-1.0, 1.0]])
    actuators = Actuators(config(matrix=rows, limits=limits))
    rng = np.random.default_rng(2)
    beyond = 0
    for _ in range(50):
        start, command = rng.uniform(-0.2, 0.2, 2), rng.uniform(-3, 3, 2)
        expected = start + farthest(rows, limits, start, command - start) * (command - start)
        for axis in range(2):
            step = np.where(np.arange(2) == axis, command - expected, 0.0)
            expected = expected + farthest(rows, limits, expected, step) * step
        found = actuators.limited(start, command)
        np.testing.assert_allclose(found, expected, atol=1e-7)
        assert not actuators.excess(found)
        beyond += bool(actuators.excess(command))
    assert beyond > 20


def farthest(rows: Floats, limits: Floats, start: Floats, way: Floats) -> float:
    """The largest share of a way from a start within limits of the motors."""
    moved, begin = rows @ way, rows @ start
    above = np.concatenate([moved, -moved])
    room = np.concatenate([limits[:, 1] - begin, begin - limits[:, 0]])
    return float(linprog([-1.0], A_ub=above[:, None], b_ub=room, bounds=[(0, 1)]).x[0])


def test_a_function_is_limited_too() -> None:
    actuators = Actuators(config(map="test_actuators:bent", limits=[[-2, 2], [-0.5, 0.5]]))
    found = actuators.limited(np.zeros(2), np.array([-0.03, 1.2]))
    motors = bent(found)
    assert (np.abs(motors) <= [2 + 1e-6, 0.5 + 1e-6]).all()
    assert motors[1] == pytest.approx(0.5, abs=1e-3)
    assert found[0] == pytest.approx(-0.03, abs=1e-9)  # not held by the other


class Rig:
    """Tip of two plays, driven by the motors of `PAIRS`."""

    control_period = 0.005

    def __init__(self, rows: ArrayLike = PAIRS) -> None:
        self.rows = np.asarray(rows)
        self.sent: list[Floats] = []

    def reset(self) -> Sample:
        self.sent, self.tip = [], np.zeros(2)
        return self.step(np.zeros(len(self.rows)))

    def step(self, motors: ArrayLike) -> Sample:
        found = np.asarray(motors)
        self.sent.append(found)
        at = np.linalg.lstsq(self.rows, found, rcond=None)[0]
        slack = np.array([2e-3, 0.25])
        self.tip = np.clip(self.tip, at - slack, at + slack)
        time = len(self.sent) * self.control_period
        seen = Tip(self.tip.copy(), time) if len(self.sent) % 8 == 0 else ()
        return Sample(time, found, None, self.tip.copy(), seen)

    def close(self) -> None:
        self.sent = []


def test_the_loop_is_the_same_with_motors_in_between() -> None:
    """`run_experiment` of motors against the one of a rig that takes the command."""

    class Direct(Rig):
        def step(self, motors: ArrayLike) -> Sample:
            sample = super().step(
                self.rows @ np.asarray(motors) if np.size(motors) == 2 else motors
            )
            return Sample(sample.time, self.rows_inverse(sample.applied), None, *rest(sample))

        def rows_inverse(self, motors: Floats) -> Floats:
            found: Floats = np.linalg.lstsq(self.rows, motors, rcond=None)[0]
            return found

    rows = np.array([[2.0, 0.0], [-2.0, 0.0], [0.0, 3.0], [1.0, -3.0]])
    motion = OperatorMotion([Sine(centre=0, amplitude=8e-3), Sine(centre=0, amplitude=0.8)], 1, 3.0)
    with_map = run_experiment(Rig(rows), motion, config(matrix=rows))
    without = run_experiment(Direct(rows), motion, config(matrix=rows).replace(actuators=None))
    for name in ("command_bend", "applied_insertion", "estimate_bend", "true_insertion"):
        np.testing.assert_allclose(with_map.trace[name], without.trace[name], atol=1e-9)
    np.testing.assert_allclose(
        with_map.trace["applied_bend"][1:], with_map.trace["command_bend"][:-1], atol=1e-9
    )


def rest(sample: Sample) -> tuple[Any, Any]:
    return sample.true_state, sample.measurement


def test_a_limited_command_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    inner = Rig()
    limits = [[-3e3, 3e3], [-3e3, 3e3], [-1e-2, 1e-2], [-1e5, 1e5]]
    names = ["pull", "push", "drum", "tendon"]
    units = ["counts", "counts", "m", "counts"]
    rig = ActuatedRig(inner, config(matrix=PAIRS, limits=limits, names=names, units=units))
    rig.reset()
    with caplog.at_level(logging.WARNING, "tautscope"):
        for insertion in (0.01, 0.02, 0.03):
            sample = rig.step([insertion, 0.5])
    (record,) = caplog.records
    assert "pull 4000 counts, push -4000 counts" in record.getMessage()
    low, high = np.array(limits).T
    assert all((low <= motors).all() and (motors <= high).all() for motors in inner.sent)
    np.testing.assert_allclose(sample.applied, [0.015, 0.5])
    # On the way back nothing is held.
    np.testing.assert_allclose(rig.step([0.012, -0.5]).applied, [0.012, -0.5])


def test_the_loop_knows_what_was_commanded_within_the_limits(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """What is not commanded is no slack, and the warnings name whose it is."""
    names, widths = ["bend_x", "bend_y"], [0.5, 0.3]
    robot = axes(2, names=names, width_limit=1.0, expected_width=widths)
    limits = [[-1.8, 1.8], [-4, 4], [-3, 3]]
    robot = robot.replace(actuators={"matrix": [[3, 0], [0, 2], [-1, 1]], "limits": limits})
    reports: list[Report] = []

    class Log:
        def tick(self, *_: Any) -> None: ...

        def event(self, *_: Any) -> None: ...

        def measurement(self, _: float, __: Measurement, report: Report) -> None:
            reports.append(report)

    motion = OperatorMotion([Sine(centre=0, amplitude=1), Sine(centre=0, amplitude=0.8)], 3, 30.0)
    run = run_experiment(PlayRig(robot, widths), motion, robot, log=Log())  # type: ignore[arg-type]
    limited, *others = (record.getMessage() for record in caplog.records)
    assert limited.startswith("bend_x: limited by actuators.limits; the command needs")
    assert not any("limited" in other for other in others)
    assert abs(run.trace["command_bend_x"]).max() == pytest.approx(0.6)
    assert abs(run.trace["reference_bend_x"]).max() > 0.7
    for name, slack in zip(names, widths, strict=True):
        command, applied = (run.trace[f"{of}_{name}"] for of in ("command", "applied"))
        np.testing.assert_allclose(applied[1:], command[:-1], atol=1e-12)
        found = run.trace[f"delta_plus_{name}"][-1] - run.trace[f"delta_minus_{name}"][-1]
        assert found == pytest.approx(slack, abs=0.05)
    what = "bend_x limited by actuators.limits"
    named = [report for report in reports if what in report.warnings]
    assert 0 < len(named) < len(reports) / 3
    assert all("monitor" in report.warnings for report in named)
    (line,) = run.warnings
    assert line.startswith("monitor (")
    assert line.endswith(f"; {what}")


def test_a_start_beyond_the_limits_is_refused() -> None:
    rig = ActuatedRig(Rig(np.eye(2)), config(map="test_actuators:bent", limits=[[-1, 1], [-1, 1]]))
    assert np.isnan(rig.reset().applied).all()  # no way back, and nothing sent yet
    with pytest.raises(SignalError, match=r"command: got \[0.5, 0.0\].*motor_1"):
        rig.step([0.5, 0.0])
    np.testing.assert_array_equal(rig.step([0.01, 0.5]).applied, [0.01, 0.5])


@pytest.mark.parametrize(
    ("actuators", "field", "message"),
    [
        ({}, "actuators.matrix", "either matrix or map"),
        ({"matrix": PAIRS, "map": "a:b"}, "actuators.matrix", "either matrix or map"),
        ({"matrix": [[1.0, 0.0]]}, "actuators.matrix", "rank 2: the motors do not determine bend"),
        ({"matrix": [[1.0, 2.0], [2.0, 4.0]]}, "actuators.matrix", "insertion and bend"),
        ({"matrix": [[1.0, 0.0, 0.0]] * 3}, "actuators.matrix[0]", "2 numbers"),
        ({"matrix": PAIRS, "offsets": [0.0]}, "actuators.offsets", "4 values, one per motor"),
        ({"matrix": PAIRS, "units": ["m"]}, "actuators.units", "4 values, one per motor"),
        ({"matrix": PAIRS, "names": list("aabc")}, "actuators.names[1]", "used once"),
        ({"matrix": PAIRS, "limits": [[1, 0]] * 4}, "actuators.limits[0]", "lower limit"),
        ({"matrix": [[1.0, math.nan]] * 2}, "actuators.matrix[0][1]", "finite"),
        ({"map": "a:b", "offsets": [1.0]}, "actuators.offsets", "map"),
    ],
)
def test_wrong_actuators_are_refused(actuators: dict[str, Any], field: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        config(**actuators)
    assert caught.value.field == field
    assert message in str(caught.value)


@pytest.mark.parametrize("kind", ["nothing", "Nothing", "NoWay", "WithArgument", "PAIRS"])
def test_a_wrong_map_is_refused(kind: str) -> None:
    with pytest.raises(ConfigError, match=r"actuators\.map"):
        Actuators(config(map=f"test_actuators:{kind}"))


def test_actuators_are_for_dofs_without_drives() -> None:
    with pytest.raises(ConfigError, match=r"actuators: got 'no \[\[dof\]\]'"):
        from_document({"actuators": {"matrix": PAIRS}})
    with pytest.raises(ConfigError, match="actuators"):
        Actuators(from_document({}))


def test_what_comes_from_the_rig_is_checked() -> None:
    rig = ActuatedRig(Rig(PAIRS[:2]), config(matrix=PAIRS))
    with pytest.raises(SignalError, match=r"sample\.applied: .* expected 4 finite numbers"):
        rig.reset()
