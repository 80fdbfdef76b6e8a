"""Wrong input of a robot's configuration, loop and rig: each error has field, value and remedy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from tautscope import (
    Camera,
    Compensator,
    Config,
    Estimator,
    HysteresisReduction,
    Instrument,
    MarkerDetector,
    Play,
    PlayRig,
    Pose,
    Sample,
    Tip,
    axes,
    run_experiment,
)
from tautscope.config import from_document
from tautscope.errors import FieldError, SignalError
from tautscope.loop.rig import check_sample
from tautscope.loop.signal_checks import check_covariance
from tautscope.loop.state_prediction import StatePrediction

Floats = NDArray[np.float64]
NAN, EYE = float("nan"), np.eye(3)
HUGE = 10**400
"""No float has this value."""
IMAGE: Any = np.zeros((Config().camera.height, Config().camera.width, 3), np.uint8)
FILE: Any = "rig.toml"


class NoTip:
    """No kinematics."""


class Quaternion:
    """A tip with a quaternion in place of a matrix."""

    def tip(self, _: object) -> object:
        return np.zeros(3), np.zeros(4)


class Words:
    """Points and a tip that are no numbers, once the loop is made."""

    def tip(self, q: Floats) -> object:
        is_first = bool(q[0] == 0.0)
        return [0.0, 0.0, 0.0 if is_first else "far"], np.eye(3)

    def points(self, _: object) -> object:
        return ["a", "b"]


class Transposed:
    """Three points, a column each."""

    def tip(self, _: object) -> object:
        return np.zeros(3), np.eye(3)

    def points(self, _: object) -> object:
        return np.zeros((2, 3))


class PositionOnly:
    """A tip without an orientation."""

    def tip(self, _: object) -> object:
        return np.zeros(3)


def one(**keys: Any) -> Config:
    return from_document({"dof": [{"name": "a", "width_limit": 1.0} | keys]})


def planes(**sections: Any) -> Config:
    dofs = [{"name": f"bend_{axis}", "width_limit": 1.0} for axis in "xy"]
    return from_document({"dof": dofs, "kinematics": {"kind": "two_planes"}} | sections)


def bend(**keys: Any) -> Config:
    """Of "two_planes" and, without a name, of "segments"."""
    other = {"name": "bend_y", "width_limit": 1.0}
    kind = {"kind": "two_planes" if "name" in keys else "segments"}
    dofs = [{"name": "a", "width_limit": 1.0} | keys, other]
    return from_document({"dof": dofs, "kinematics": kind})


def kind(name: str) -> HysteresisReduction:
    return HysteresisReduction(planes(kinematics={"kind": name}))


def loop(name: str = "two_planes") -> HysteresisReduction:
    made = kind(name)
    made.step([0.0, 0.0], 0.0)
    return made


def camera() -> Camera:
    return Camera(fx=500, fy=500, cx=320, cy=240, distortion=(0,) * 8)


def instrument() -> Instrument:
    lengths = {"bending_length": 0.02, "marker_a": 0.005, "marker_b": 0.015}
    return Instrument(**lengths, radius=0.001, band_length=0.002)


def compensator(**settings: Any) -> Compensator:
    offsets = {"delta_minus": -0.1, "delta_plus": 0.1}
    return Compensator(**{"free_gain": 5, "gain_limit": 5, **offsets, **settings})


def estimator() -> Estimator:
    shares = {"contact_tolerance": 0.4, "smoothing_factor": 0.25}
    return Estimator(update_distance=0.02, **shares, delta_minus=-0.1, delta_plus=0.1)


def sample(**parts: Any) -> Sample:
    whole = {"time": 0.0, "applied": np.zeros(2)} | parts
    return check_sample(Sample(**whole), planes())


Case = tuple[Callable[[], object], str, str, str]
"""A call, and of its error the field, a part of the value, and a part of what is allowed."""
CONFIGURATIONS: list[Case] = [
    (lambda: one(name="Bend X"), "dof[0].name", "Bend X", "^[a-z]"),
    (lambda: one(name=""), "dof[0].name", "''", "1 to 32 characters"),
    (lambda: one(unit="deg"), "dof[0].unit", "deg", '"m" or "rad"'),
    (lambda: one(width_limit=0.0), "dof[0].width_limit", "0.0", "above 0"),
    (lambda: one(width_limit=NAN), "dof[0].width_limit", "nan", "a number above 0"),
    (lambda: one(width_limit="1 rad"), "dof[0].width_limit", "1 rad", "a number above 0"),
    (lambda: one(range=[1.0, -1.0]), "dof[0].range", "1.0, -1.0", "lower limit, then the upper"),
    (lambda: one(range=[-180, 180]), "dof[0].range", "-180", "not mm and degrees"),
    (lambda: one(range=[1.0]), "dof[0].range", "[1.0]", "2 values"),
    (lambda: one(speed=-1.0), "dof[0].speed", "-1.0", "above 0"),
    (lambda: one(lever=0.0), "dof[0].lever", "0.0", "above 0"),
    (lambda: one(lever=2.0), "dof[0].lever", "2.0", "shares no friction"),
    (lambda: one(friction="shaft"), "dof[0].friction", "shaft", "two or more"),
    (lambda: planes(insertion={"recovery": 0.1}), "insertion.recovery", "0.1", "not used"),
    (lambda: from_document({"measurement": {"delays": [0.1]}}), "measurement.delays", "0.1",
     "not used without [[dof]]"),
    (lambda: from_document({"kinematics": {"length": 0.1}}), "kinematics.length", "0.1", "without"),
    (lambda: one(gain_limit=0.5), "dof[0].gain_limit", "0.5", "from 1 to 50"),
    (lambda: one(expected_width=2.0), "dof[0].expected_width", "2.0", "width_limit"),
    (lambda: one(delta_minus=0.2), "dof[0].delta_minus", "0.2", "delta_plus"),
    (lambda: one(delta_plus=0.8), "dof[0].delta_plus", "0.8", "0.667, 2/3 width_limit"),
    (lambda: one(delta_minus=-0.6, delta_plus=0.6), "dof[0].delta_plus", "0.6", "at most 0.4"),
    (lambda: one(widht=1.0), "dof[0].widht", "1.0", "no such key"),
    (lambda: from_document({"dof": [{"name": "a"}]}), "dof[0].width_limit", "None", "no default"),
    (lambda: from_document({"dof": {"name": "a"}}), "dof", "'a'", "a list"),
    (lambda: axes(2, width_limit=1.0, names=["a", "a"]), "dof[1].name", "'a'", "used once"),
    (lambda: axes(9, width_limit=1.0), "count", "9", "1 to 8"),
    (lambda: axes(3, width_limit=[1.0, 2.0]), "width_limit", "[1.0, 2.0]", "one value, or 3"),
    (lambda: from_document({"dof": [{"name": f"a{k}", "width_limit": 1.0} for k in range(9)]}),
     "dof", "9 entries", "1 to 8"),
    (lambda: planes(safety={"width_limit": [1.0] * 3}), "safety.width_limit", "1.0", "[[dof]]"),
    (lambda: planes(measurement={"delays": [-0.1]}), "measurement.delays[0]", "-0.1", "at least 0"),
    (lambda: planes(measurement={"delays": [0.1] * 5}), "measurement.delays", "0.1", "at most 4"),
    (lambda: planes(kinematics={"length": 0}), "kinematics.length", "0", "above 0"),
    (lambda: planes(kinematics={"kind": "two_planes", "without": ["grip"]}),
     "kinematics.without[0]", "grip", "a name of [[dof]]"),
    (lambda: bend(name="insertion", width_limit=12.0, range=[0, 100]),
     "dof[0].unit", "rad", 'unit = "m" and its other values in m'),
    (lambda: bend(name="insertion", unit="m", width_limit=12.0),
     "dof[0].width_limit", "12.0", "at most 1 m"),
    (lambda: bend(name="rotation", unit="m"), "dof[0].unit", "m", 'unit = "rad"'),
    (lambda: bend(name="bend_x", unit="m"), "dof[0].unit", "m", 'unit = "rad"'),
    (lambda: bend(name="bend_x", width_limit=5.0, range=[-90, 90]),
     "dof[0].range", "-90", "6.28, a turn; in rad, not degrees"),
    (lambda: bend(name="bend_x", width_limit=30.0), "dof[0].width_limit", "30.0", "not degrees"),
    (lambda: bend(unit="m"), "dof[0].unit", "m", 'unit = "rad"'),
    (lambda: bend(range=[0.0, 7.0]), "dof[0].range", "7.0", "not degrees"),
    (lambda: planes(kinematics={"without": ["bend_x"]}), "kinematics.without[0]", "bend_x", "kind"),
    (lambda: kind("joint"), "kinematics.kind", "joint", '"two_planes"'),
    (lambda: kind("no_such_module:Robot"), "kinematics.kind", "no_such_module", "module:Class"),
    (lambda: kind("test_wrong_input:Nothing"), "kinematics.kind", "Nothing", "module:Class"),
    (lambda: kind("test_wrong_input:NoTip"), "kinematics.kind", "NoTip", "the method tip(q)"),
    (lambda: kind("test_wrong_input:Quaternion").on_pose([0, 0, 0], 0.0),
     "kinematics.kind", "Quaternion", "(3, 3)"),
    (lambda: kind("test_wrong_input:PositionOnly").on_pose([0, 0, 0], 0.0),
     "kinematics.kind", "PositionOnly", "(3, 3)"),
    (lambda: planes(estimation={"marker_deviation": 0.2}),
     "estimation.marker_deviation", "0.2", "[[dof]] has no bands"),
    (lambda: axes(2.0, width_limit=1.0), "count", "2.0", "1 to 8"),
    (lambda: axes(2, width_limit=1.0, names=5), "names", "5", "a list of 2"),
    (lambda: from_document({"insertion": {"delta_minus": -5.0, "delta_plus": 5.0}}),
     "insertion.delta_minus", "-5.0", "0.008, safety.offset_limit"),
    (lambda: from_document({"drives": {"preset": "epos4", "waive": [["6007"]]}}),
     "drives.waive[0]", "6007", 'or "6007"'),
    (lambda: HysteresisReduction(one().replace(**{"kinematics.kind": "two_planes"})),
     "dof.name", "'a'", "bend_x"),
    (lambda: HysteresisReduction(FILE), "config", "'rig.toml'", "load_config(path)"),
    (lambda: MarkerDetector(FILE), "config", "'rig.toml'", "load_config(path)"),
    (lambda: PlayRig(FILE), "config", "'rig.toml'", "load_config(path)"),
    (lambda: run_experiment(PlayRig(planes()), len, FILE),  # type: ignore[arg-type]
     "config", "'rig.toml'", "load_config(path)"),
]  # fmt: skip
ARRAYS: list[Case] = [
    (lambda: camera().project([1, 2, 3]), "points", "[1, 2, 3]", "an array (n, 3)"),
    (lambda: camera().jacobian("a"), "point", "'a'", "an array (3,)"),
    (lambda: Camera(fx=1, fy=1, cx=0, cy=0, distortion=(0,) * 5),  # type: ignore[arg-type]
     "distortion", "5 values", "8 values"),
    (lambda: instrument().markers([[0.0] * 3]), "state", "[[0.0", "an array (3,)"),
    (lambda: instrument().jacobian([HUGE, 0, 0]), "state", "[1000", "an array (3,)"),
    (lambda: Play(delta_minus=0, delta_plus=1).run([[1]]), "inputs", "[[1]]", "an array (n,)"),
    (lambda: compensator(free_gain=HUGE), "free_gain", "1000", "a float, or an array"),
    (lambda: compensator(recovery="a"), "recovery", "'a'", "a float, or an array"),
    (lambda: compensator(delta_plus=[[1]]), "delta_plus", "1 values", "a float, or an array"),
    (lambda: compensator().step("a"), "reference", "'a'", "a float, or an array"),
    (lambda: compensator().run("a"), "references", "'a'", "numbers"),
    (lambda: estimator().update(0.0, "a"), "measured", "'a'", "a float, or an array"),
    (lambda: estimator().run([0.0], [HUGE]), "measured", "[1000", "numbers"),
]  # fmt: skip
SIGNALS: list[Case] = [
    (lambda: loop().step([0.0] * 3), "reference", "[0.0, 0.0, 0.0]", "2 finite numbers"),
    (lambda: loop().step([0.0, NAN]), "reference", "nan", "2 finite numbers"),
    (lambda: loop().step("ab"), "reference", "'ab'", "2 finite numbers"),
    (lambda: loop().step([HUGE, 0.0]), "reference", "[1000", "2 finite numbers"),
    (lambda: loop().step([0.0, 0.0], HUGE), "time", "1000", "finite number of seconds"),
    (lambda: loop().step([0.0, 0.0], NAN), "time", "nan", "finite number of seconds"),
    (lambda: loop().on_tip([0.0], 0.0), "values", "[0.0]", "an array (2,)"),
    (lambda: loop().on_tip([NAN, NAN], 0.0), "values", "[nan, nan]", "not all NaN"),
    (lambda: loop().on_tip([np.inf, 0.0], 0.0), "values", "inf", "numbers or NaN"),
    (lambda: loop().on_tip("ab", 0.0), "values", "'ab'", "an array (2,)"),
    (lambda: loop().on_tip([[0], [0, 1]], 0.0), "values", "[[0], [0, 1]]", "an array (2,)"),
    (lambda: loop().on_tip([0.0, 0.0], NAN), "captured_at", "nan", "seconds"),
    (lambda: loop().on_tip([0.0, 0.0], "now"), "captured_at", "'now'", "seconds"),
    (lambda: loop().on_tip([0.0, 0.0], 0.0, EYE), "covariance", "1.0", "(2, 2)"),
    (lambda: loop().on_tip([0.0, 0.0], 0.0, [0.1, 0.1]), "covariance", "0.1", "(2, 2)"),
    (lambda: loop().on_tip([0.0, 0.0], 0.0, [[1, 2], [0, 1]]), "covariance", "2.0", "symmetric"),
    (lambda: loop().on_tip([0.0, 0.0], 0.0, -EYE[:2, :2]), "covariance", "-1.0", "positive"),
    (lambda: loop().on_tip([0.0, 0.0], 0.0, sensor=4), "sensor", "4", "0 to 3"),
    (lambda: loop().on_pose([0.0] * 2, 0.0), "position", "[0.0, 0.0]", "an array (3,)"),
    (lambda: loop().on_pose([0.0] * 3, 0.0, [0, 0, 0, 2]), "orientation", "2.0", "of length 1"),
    (lambda: loop().on_pose([0.0] * 3, 0.0, [NAN, 0, 0, 1]), "orientation", "nan", "quaternion"),
    (lambda: loop().on_pose([0.0] * 3, 0.0, [0, 0, 0]), "orientation", "[0.0", "x, y, z, w"),
    (lambda: loop().on_pose([0.0] * 3, 0.0, -EYE), "orientation", "-1.0", "rotation matrix (3, 3)"),
    (lambda: loop().on_pose([0.0] * 3, 0.0, 2 * EYE), "orientation", "2.0", "rotation matrix"),
    (lambda: loop().on_pose([0.0] * 3, 0.0, EYE, EYE), "covariance", "1.0", "(6, 6)"),
    (lambda: loop().on_points([[0.0, 0.0]], 0.0), "on_points", "two_planes", "points(q)"),
    (lambda: loop().on_measurement([], 0.0, EYE, len), "values", "(0,)", "1 to 16"),
    (lambda: loop().on_measurement(np.ones(17), 0.0, EYE, len), "values", "(17,)", "1 to 16"),
    (lambda: loop().on_measurement([[1], [1, 2]], 0.0, EYE, len), "values", "[1, 2]", "1 to 16"),
    (lambda: loop().on_measurement([1.0], 0.0, [[1.0]], lambda q: q), "predict(q)", "(2,)", "(1,)"),
    (lambda: loop().on_measurement([1.0], 0.0, [[1.0]], lambda q: q[:1], jacobian=lambda q: q),
     "jacobian(q)", "(2,)", "(1, 2)"),
    (lambda: loop().on_measurement([1.0], 0.0, [[1.0]], lambda _: "a"),  # type: ignore[arg-type]
     "predict(q)", "'a'", "an array (1,)"),
    (lambda: loop().on_measurement([1.0, 1.0], 0.0, EYE[:2, :2], lambda _: [[1], [1, 2]]),  # type: ignore[arg-type]
     "predict(q)", "[1, 2]", "an array (2,)"),
    (lambda: loop().on_measurement([1.0], 0.0, [[1.0]], None),  # type: ignore[arg-type]
     "predict", "None", "a function of q"),
    (lambda: loop().on_measurement([1.0], 0.0, [[1.0]], len, jacobian=EYE),  # type: ignore[arg-type]
     "jacobian", "1.", "a function of q"),
    (lambda: loop("test_wrong_input:Words").on_pose([0.0] * 3, 0.0), "tip(q)", "far", "array (3,)"),
    (lambda: loop("test_wrong_input:Words").on_points([[0.0, 0.0]], 0.0),
     "points(q)", "'a'", "an array (1, 2)"),
    (lambda: loop("test_wrong_input:Transposed").on_points(np.zeros((3, 2)), 0.0),
     "points(q)", "(2, 3)", "an array (3, 2)"),
    (lambda: HysteresisReduction(Config()).on_frame(IMAGE),
     "frame", "ndarray", "a tautscope.Frame"),
    (lambda: HysteresisReduction(Config()).on_detection(None, None),  # type: ignore[arg-type]
     "frame", "NoneType", "a tautscope.Frame"),
    (lambda: MarkerDetector(Config()).detect(IMAGE, None, np.zeros(3)),  # type: ignore[arg-type]
     "expectation", "ndarray", "a StatePrediction"),
    (lambda: MarkerDetector(Config()).detect(IMAGE, None, StatePrediction(EYE[0], EYE[0, :2])),
     "expectation.std", "[1.0, 0.0]", "3 numbers"),
    (lambda: MarkerDetector(Config()).regions_in(IMAGE, [(0, 0, 5)]),  # type: ignore[list-item]
     "windows", "[[0.0, 0.0, 5.0]]", "four whole numbers"),
    (lambda: MarkerDetector(Config()).regions_in(IMAGE, [(0, 0, 5, NAN)]),  # type: ignore[list-item]
     "windows", "nan", "four whole numbers"),
    (lambda: loop().on_features(np.ones(4), 0.0), "on_features", "[[dof]]", "on_tip"),
    (lambda: HysteresisReduction(Config()).on_features(list("abcd"), 0.0),
     "features", "'a'", "4 finite numbers"),
    (lambda: HysteresisReduction(Config()).on_features([[0], [0, 1]], 0.0),
     "features", "[0, 1]", "4 finite numbers"),
    (lambda: HysteresisReduction(Config()).on_features([NAN] * 4, 0.0),
     "features", "nan", "None where neither band was found"),
    (lambda: loop().on_sample((Tip([0, 0], 0.0),)),  # type: ignore[arg-type]
     "measurement", "tuple", "Tip, Pose or Points"),
    (lambda: loop().on_tip([0.0, 0.0], 0.0, sensor=1.0),  # type: ignore[arg-type]
     "sensor", "1.0", "0 to 3"),
    (lambda: loop().set_compensation("all"),  # type: ignore[arg-type]
     "compensation", "'all'", "0 to 1"),
    (lambda: loop().predict_state(0.0), "predict_state", "[[dof]]", "on_tip"),
    (lambda: HysteresisReduction(Config()).on_tip([0.0], 0.0), "on_tip", "no [[dof]]", "axes"),
    (lambda: loop().set_compensation(HUGE), "compensation", "1000", "0 to 1"),
    (lambda: loop().set_compensation(1.5), "compensation", "1.5", "0 to 1"),
]  # fmt: skip
SAMPLES: list[Case] = [
    (lambda: check_sample((0.0, [0, 0]), planes()),  # type: ignore[arg-type]
     "sample", "tuple", "tautscope.Sample"),
    (lambda: sample(time=NAN), "sample.time", "nan", "seconds"),
    (lambda: sample(time="0"), "sample.time", "'0'", "seconds"),
    (lambda: sample(applied=np.zeros(3)), "sample.applied", "(3,)", "an array (2,)"),
    (lambda: sample(applied=None), "sample.applied", "None", "an array (2,)"),
    (lambda: sample(applied=[[0], [0, 1]]), "sample.applied", "[0, 1]", "an array (2,)"),
    (lambda: sample(true_state=[0.0]), "sample.true_state", "(1,)", "an array (2,)"),
    (lambda: sample(frame=np.zeros((2, 2, 3))), "sample.frame", "ndarray", "tautscope.Frame"),
    (lambda: sample(measurement=1.0), "sample.measurement", "float", "Tip, Pose or Points"),
    (lambda: sample(measurement=[Tip([0, 0], 0.0)]), "sample.measurement", "list", "in a tuple"),
    (lambda: sample(measurement=None), "sample.measurement", "NoneType", "Tip, Pose or Points"),
    (lambda: sample(measurement=Tip([0, 0], NAN)),
     "sample.measurement.captured_at", "nan", "seconds"),
]  # fmt: skip


@pytest.mark.parametrize(
    "case", [*CONFIGURATIONS, *ARRAYS, *SIGNALS, *SAMPLES], ids=lambda case: case[1]
)
def test_an_error_says_where_what_and_what_may_come(case: Case) -> None:
    call, field, value, allowed = case
    with pytest.raises(FieldError) as caught:
        call()
    assert caught.value.field == field
    found, _, expected = str(caught.value).removeprefix(f"{field}: got ").partition(", expected ")
    assert value in found
    assert allowed in expected


def test_a_time_may_be_any_number() -> None:
    found = HysteresisReduction(planes())
    for time in (np.int64(1), 2, np.float32(3.0), 4.0):
        found.step([0.0, 0.0], time)


def test_a_covariance_that_was_turned_is_symmetric_up_to_rounding() -> None:
    for turn in Rotation.random(50, rng=1).as_matrix():
        turned = turn @ (1e-4 * np.eye(3)) @ turn.T
        assert (check_covariance("covariance", turned, 3) == turned).all()


def test_what_is_masked_was_not_measured() -> None:
    for masked in ([0.5, 0.0], [5, 0]):
        report = loop().on_tip(np.ma.array(masked, mask=[True, False]), 0.0)
        assert report.observable.tolist() == [False, True]
        assert np.isnan(report.innovation[0])
    with pytest.raises(SignalError, match=r"^reference: got \[nan, 0.0\]"):
        loop().step(np.ma.array([0.0, 0.0], mask=[True, False]))
    turned = np.ma.array([0.0, 0.0, 0.0, 1.0], mask=[True, False, False, False])
    with pytest.raises(SignalError, match=r"^orientation: got \[nan"):
        loop().on_sample(Pose([0.0] * 3, 0.0, turned))
