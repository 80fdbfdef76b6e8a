"""The fit of the geometry: known truths, the twin, free directions, contradictions, bad input."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from calibration.records import Case, Instrument
from simulated_motion import DELAY, actual, simulate, told
from tautscope.calibration.geometry import GeometryFit, Recording, fit, sweep
from tautscope.calibration.geometry.checks import shortness
from tautscope.config import Config
from tautscope.errors import FieldError, MotionHeldError, RecordError, SignalError
from tautscope.loop.rig import Sample
from tautscope.twin import Twin
from tautscope.twin.drawn_rig import draw_geometry


@cache
def plain_fit() -> GeometryFit:
    return fit(simulate()[0], told())


def channel(config: Config) -> np.ndarray:
    """Direction (3,) of the channel in the camera frame."""
    return cv2.Rodrigues(np.array(config.camera.camera_from_guide.rotation))[0][:, 2]


def angle(one: Config, other: Config) -> float:
    """Between the channels of two configurations [deg]."""
    return float(np.degrees(np.arccos(min(channel(one) @ channel(other), 1.0))))


def across(one: Config, other: Config) -> float:
    """Distance of two guides across the second's channel, in the scale of the first's bands [m]."""
    scale = (one.instrument.marker_b - one.instrument.marker_a) / (
        other.instrument.marker_b - other.instrument.marker_a
    )
    shift = np.array(one.camera.camera_from_guide.translation) / scale
    shift -= np.array(other.camera.camera_from_guide.translation)
    direction = channel(other)
    return float(np.linalg.norm(shift - (shift @ direction) * direction))


def test_a_known_geometry_is_found_within_its_standard_deviations() -> None:
    found, rig = plain_fit(), actual()
    assert found.is_plausible, found.warnings
    for key, truth in (
        ("instrument.bending_length", rig.instrument.bending_length),
        ("instrument.marker_a", rig.instrument.marker_a),
        ("instrument.marker_b", rig.instrument.marker_b),
        ("camera.fx", rig.camera.fx),
        ("camera.source.delay", DELAY),
    ):
        assert abs(found.changes[key] - truth) < 3 * found.std[key], key
    shift = np.subtract(
        found.config.camera.camera_from_guide.translation, rig.camera.camera_from_guide.translation
    )
    std = [found.std[f"camera.camera_from_guide.translation[{k}]"] for k in range(3)]
    assert (np.abs(shift) < 3 * np.array(std)).all()
    assert angle(found.config, rig) < 0.3
    assert across(found.config, rig) < 0.3e-3
    assert found.residual_px < 0.3


@pytest.mark.parametrize(("before", "error"), [(0.1, 0.0), (0.1, 0.35)])
def test_a_configured_delay_is_part_of_the_result(before: float, error: float) -> None:
    """The camera has subtracted it from its stamps, which are also too early by an error [s]."""
    recording, key = simulate()[0], "camera.source.delay"
    stamps = recording.captured_at - before - error
    found = fit(replace(recording, captured_at=stamps), told().replace(**{key: before}))
    value = next(each for each in found.values if each.name == key)
    assert value.before == before
    assert found.changes[key] == found.config.camera.source.delay == max(value.after, 0.0)
    assert abs(value.after - (DELAY - error)) < 3 * found.std[key]
    early = any("before the motors' clock" in warning for warning in found.warnings)
    assert early == (error > DELAY)


def test_a_measured_distance_sets_the_scale() -> None:
    rig = actual()
    distance = rig.instrument.marker_b - rig.instrument.marker_a
    recording, _ = simulate()
    motors = recording.motors.copy()
    start = motors[0, 0]
    # An insertion drive that is calibrated wrong by 20 %.
    motors[:, 0] = start + 1.2 * (motors[:, 0] - start)
    found = fit(replace(recording, motors=motors), told(), band_distance=distance)
    assert found.is_plausible, found.warnings
    one = found.config.instrument
    assert one.marker_b - one.marker_a == pytest.approx(distance, rel=1e-9)
    assert across(found.config, rig) < 0.3e-3
    gain = next(value.after for value in found.values if value.name == "gain insertion")
    assert gain == pytest.approx(np.log(1 / 1.2), abs=0.05)


@pytest.mark.parametrize(("duration", "rest"), [(20.0, 0.0), (20.0, 40.0), (60.0, 0.0)])
def test_a_short_motion_is_reported(duration: float, rest: float) -> None:
    """Also within a long record."""
    recording, _ = simulate(duration=duration)
    time, motors = recording.time, recording.motors
    extra = duration + np.arange(0.01, rest, 0.01)
    motors = np.vstack([motors, np.repeat(motors[-1:], len(extra), axis=0)])
    short = shortness(replace(recording, time=np.append(time, extra), motors=motors))
    assert ("The motors moved for only 20 s" in short) == (duration < 40)
    if not rest:
        assert (short in fit(recording, told()).warnings) == (duration < 40)


def relative_scale(config: Config) -> float:
    """Distance of the bands over the true one, minus 1."""
    one, other = config.instrument, actual().instrument
    return (one.marker_b - one.marker_a) / (other.marker_b - other.marker_a) - 1


def asks_for_the_distance(found: GeometryFit) -> bool:
    return any("--band-distance" in warning for warning in found.warnings)


def test_a_tip_that_follows_within_its_play_costs_neither_scale_nor_delay() -> None:
    """A soft channel: the tip moves by 30 % of the drive's travel while the shaft sticks."""
    found = fit(simulate(elastic=0.3)[0], told())
    assert found.is_plausible and asks_for_the_distance(found), found.warnings
    assert abs(relative_scale(found.config)) < 0.02
    key = "camera.source.delay"
    assert abs(found.changes[key] - DELAY) < 3 * found.std[key] < 0.1
    assert not asks_for_the_distance(plain_fit())


def test_loops_that_no_play_has_are_reported_where_they_set_the_scale() -> None:
    recording, _ = simulate()
    motors = recording.motors.copy()
    # An insertion drive whose position wanders by a millimetre.
    motors[:, 0] += 1e-3 * np.sin(2 * np.pi * recording.time / 13.7)
    wandering, rig = replace(recording, motors=motors), actual().instrument
    assert asks_for_the_distance(fit(wandering, told()))
    distance = rig.marker_b - rig.marker_a
    assert not asks_for_the_distance(fit(wandering, told(), band_distance=distance))


@pytest.mark.parametrize(("dof", "zero"), [(0, 3e-3), (1, 0.1)])
def test_zeros_of_insertion_and_rotation_are_those_of_the_drives(dof: int, zero: float) -> None:
    """A drive whose zero is elsewhere moves the guide along the channel, or rolls it."""
    recording, _ = simulate()
    motors = recording.motors.copy()
    motors[:, dof] += zero
    plain, found = plain_fit(), fit(replace(recording, motors=motors), told())
    assert angle(found.config, plain.config) < 0.1
    assert across(found.config, plain.config) < 0.1e-3
    before, after = (each.config.camera.camera_from_guide for each in (plain, found))
    moved = channel(plain.config) @ np.subtract(after.translation, before.translation)
    old, new = (cv2.Rodrigues(np.array(each.rotation))[0] for each in (before, after))
    rolled = cv2.Rodrigues(old.T @ new)[0].ravel()[2]
    expected = (-zero, 0.0) if dof == 0 else (0.0, -zero)
    assert moved == pytest.approx(expected[0], abs=0.4e-3)
    assert rolled == pytest.approx(expected[1], abs=0.02)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_geometry_of_a_twin_is_found(seed: int) -> None:
    """Its hysteresis comes out of friction, its features out of rendered images."""
    case = Case(seed)
    found = fit(case.record(), case.told)
    assert found.is_plausible, found.warnings
    assert angle(found.config, case.actual) < min(0.6, 0.3 * angle(case.told, case.actual))
    assert across(found.config, case.actual) < min(0.8e-3, 0.4 * across(case.told, case.actual))
    delay = found.config.camera.source.delay
    assert delay == pytest.approx(case.actual.twin.sensor.stamp_error, abs=0.05)


@pytest.mark.parametrize(("instrument", "seed"), [("gains 0.7", 600), ("distributed play", 602)])
def test_widths_that_never_rest_are_no_doubt(instrument: Instrument, seed: int) -> None:
    """The half widths of these twins alternate between two values at the end of the fit."""
    case = Case(seed, instrument)
    rig = case.actual.instrument
    found = fit(case.record(), case.told, band_distance=rig.marker_b - rig.marker_a)
    assert found.is_plausible, found.warnings
    assert angle(found.config, case.actual) < 1


def test_a_twin_is_calibrated_by_its_images() -> None:
    """The second detection finds bands that the wrong geometry has missed, and agrees with it."""
    case = Case(3)
    rig, shares = Twin(case.actual.replace(**{"twin.frame_rate": 12.5})), []
    try:
        recording = sweep(rig, case.told, duration=25.0, progress=shares.append)
    finally:
        rig.close()
    assert shares == sorted(shares) and shares[-1] == 1.0
    found = fit(recording, case.told)
    assert found.is_plausible, found.warnings
    assert found.found_share > max(recording.found.mean(), 0.9)
    assert found.residual_px < 0.5
    assert angle(found.config, case.actual) < 0.6


@pytest.mark.parametrize("kind", ["mirrored", "bands exchanged", "wrong sign"])
def test_a_record_that_the_model_cannot_explain_is_not_plausible(kind: str) -> None:
    recording, _ = simulate(duration=30.0)
    features, motors = recording.features.copy(), recording.motors.copy()
    if kind == "mirrored":
        features[:, [0, 2]] = told().camera.width - 1 - features[:, [0, 2]]
    elif kind == "bands exchanged":
        features = features[:, [2, 3, 0, 1]]
    else:
        motors[:, 1] *= -1
    found = fit(replace(recording, features=features, motors=motors), told())
    assert not found.is_plausible
    assert found.warnings


def still(recording: Recording, dof: int) -> Recording:
    motors = recording.motors.copy()
    motors[:, dof] = motors[0, dof]
    return replace(recording, motors=motors)


def lost(recording: Recording) -> Recording:
    features = recording.features.copy()
    features[30:] = np.nan
    return replace(recording, features=features, reasons={"no region": 700})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda recording: still(recording, 0), "motors.insertion: got 'a travel of 0 mm'"),
        (lambda recording: still(recording, 2), "motors.bending"),
        (lost, "no region"),
        (lambda recording: replace(recording, saturated=0.6), "60% of the pixels"),
        (
            lambda recording: replace(
                recording, features=np.tile(recording.features[:1], (len(recording.features), 1))
            ),
            "frozen",
        ),
    ],
)
def test_a_record_that_determines_nothing_is_refused(change, message: str) -> None:
    recording, _ = simulate(duration=20.0)
    with pytest.raises(RecordError, match=message):
        fit(change(recording), told())


def test_a_malformed_record_is_refused() -> None:
    recording, _ = simulate(duration=5.0)
    with pytest.raises(SignalError, match="motors"):
        replace(recording, motors=recording.motors[:, :2])
    with pytest.raises(SignalError, match="time"):
        replace(recording, time=recording.time[::-1])
    with pytest.raises(SignalError, match="captured_at"):
        replace(recording, captured_at=recording.captured_at * np.nan)
    with pytest.raises(SignalError, match="captured_at: got 'a time before the last'"):
        replace(recording, captured_at=recording.captured_at[::-1])
    with pytest.raises(SignalError, match="time: got 'no time'"):
        replace(recording, time=np.empty(0), motors=np.empty((0, 3)))
    for name in ("time", "motors", "captured_at", "features"):
        with pytest.raises(SignalError, match=f"^{name}: got"):
            replace(recording, **{name: ["a"]})
    for distance in (0.001, np.nan, np.inf, "x", [0.01]):
        with pytest.raises(FieldError, match=r"^band_distance: got"):
            fit(recording, told(), band_distance=distance)


class _Rig:
    """A twin without images whose clock can stall."""

    def __init__(self, stall: float) -> None:
        self._twin, self._stall = Twin(told(), images=False), stall
        self.control_period = self._twin.control_period
        self.commands: list[np.ndarray] = []

    def reset(self) -> Sample:
        return self._twin.reset()

    def step(self, command: np.ndarray) -> Sample:
        self.commands.append(np.array(command))
        sample = self._twin.step(command)
        return replace(sample, time=sample.time + self._stall * (sample.time > 1.0))


def test_the_sweep_is_within_range_and_speed_and_needs_images() -> None:
    config, rig = told(), _Rig(0.0)
    with pytest.raises(RecordError, match="0 images"):
        sweep(rig, config, duration=8.0)
    commands = np.array(rig.commands)
    sines = [config.experiment.insertion, config.experiment.rotation, config.experiment.bending]
    centre, size = (np.array([getattr(s, n) for s in sines]) for n in ("centre", "amplitude"))
    assert (np.abs(commands - centre) <= size * (1 + 1e-9)).all()
    assert (np.ptp(commands, axis=0) > 1.9 * size).all()
    speed = np.abs(np.diff(commands, axis=0)).max(axis=0) / config.control.period
    assert (speed <= 0.5 * np.array(config.safety.reference_speed)).all()


def test_the_sweep_ends_where_the_loop_holds_motion() -> None:
    with pytest.raises(MotionHeldError, match="late_tick"):
        sweep(_Rig(0.5), told(), duration=8.0)


def test_the_seed_decides_how_the_twin_differs() -> None:
    one, other = draw_geometry(told(), 5), draw_geometry(told(), 6)
    assert one == draw_geometry(told(), 5) != other
    assert one.camera.cx == told().camera.cx
    assert 0 <= one.twin.sensor.stamp_error <= 0.2
