"""The units in FMPy: the same numbers as in Python."""

import ctypes
import re
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import build
import fmpy
import numpy as np
import pytest
import record
from conftest import Builder
from fmpy.validation import validate_fmu
from fmu import CONFIG, DOFS, PERIOD, Unit, motion
from tautscope import Config, HysteresisReduction, MarkerDetector, Twin, axes
from tautscope.config import Profile
from tautscope.loop.reduction import Status

FEATURES = tuple(f"features_{name}" for name in build.COORDINATES)
PRESSED = 2000
"""Ticks for which an action stays set: it acts once, and longer than until the next engagement."""

KINDS = pytest.mark.parametrize("kind", ["twin", "loop"])


@KINDS
def test_units_are_valid_and_have_every_function(
    kind: str, builder: Builder, tmp_path: Path
) -> None:
    path = builder(kind, CONFIG)
    assert validate_fmu(str(path)) == []
    declared = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text("utf-8")
    names = set(re.findall(r"^FMI3_Export fmi3\w+TYPE\s+(fmi3\w+);", declared, re.M))
    assert len(names) > 70
    with zipfile.ZipFile(path) as archive:
        (library,) = [name for name in archive.namelist() if name.startswith("binaries/")]
        loaded = ctypes.CDLL(archive.extract(library, tmp_path))
    assert [name for name in sorted(names) if not hasattr(loaded, name)] == []


@pytest.mark.parametrize(("has_camera", "duration"), [(True, 15), (False, 60)])
def test_the_twin_in_fmpy_is_the_twin_in_python(
    has_camera: bool, duration: float, builder: Builder
) -> None:
    """Simulated by FMPy's own master from a table of commands."""
    ticks = round(duration / PERIOD)
    commands = [(k * PERIOD, *motion(k * PERIOD)) for k in range(ticks)]
    inputs = [("time", float), *((f"command_{dof}", float) for dof in DOFS)]
    outputs = ["has_image", "captured_at", *FEATURES]
    outputs += [f"{prefix}_{dof}" for prefix in ("applied", "true") for dof in DOFS]
    begin = time.perf_counter()
    result = fmpy.simulate_fmu(
        str(builder("twin", CONFIG)),
        stop_time=ticks * PERIOD,
        output_interval=PERIOD,
        input=np.array(commands, dtype=inputs),
        start_values={"seed": 3, "has_camera": has_camera},
        output=outputs,
    )
    took = time.perf_counter() - begin
    assert len(result) == ticks + 1

    twin, detector = Twin(CONFIG, images=has_camera), MarkerDetector(CONFIG)
    seen = np.full(5, np.nan)
    expected = []
    for k in range(ticks + 1):
        sample = twin.step(commands[k - 1][1:]) if k else twin.reset()
        if sample.frame is not None:
            seen = np.array(
                [sample.frame.captured_at, *detector.detect(sample.frame.image).features]
            )
        assert sample.true_state is not None
        expected.append((sample.frame is not None, *seen, *sample.applied, *sample.true_state))
    values = np.array([result[name] for name in outputs], dtype=np.float64).T
    difference = np.nanmax(np.abs(values - np.array(expected, dtype=np.float64)))
    print(f"twin, camera {has_camera}: {ticks} ticks in {took:.1f} s, difference {difference}")
    np.testing.assert_array_equal(values, np.array(expected, dtype=np.float64))
    assert values[:, 0].sum() == (pytest.approx(duration * 25, abs=5) if has_camera else 0)
    assert np.ptp(values[:, -3:], axis=0).min() > 5e-3, "the tip did not move"


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_the_loop_in_fmpy_is_the_loop_in_python(
    profile: Profile, recorded: Callable[[Profile], record.Record], opened: Callable[..., Unit]
) -> None:
    """60 s at 1 kHz with lost bands, jumps, old references, a drive fault and half compensation."""
    recording = recorded(profile)
    unit = opened("loop", recording.config)
    images = {int(row[0]): row for row in recording.images}
    commands, answers = [], []
    pressed: dict[str, int] = {}
    begin = time.perf_counter()
    for k, (at, made_at, *reference, event, _, _, _) in enumerate(recording.ticks):
        unit.set_all("reference", np.array(reference))
        unit.set("reference_age", at - made_at)
        for action, name in enumerate(("engage", "acknowledge", "drive_fault"), 1):
            pressed[name] = k if event == action else pressed.get(name, -PRESSED)
            unit.set(name, k < pressed[name] + PRESSED)
        if event in (4, 5):
            unit.set("compensation", 0.5 if event == 4 else 1.0)
        image = images.get(k)
        unit.set("has_image", image is not None)
        if image is not None:
            unit.set("captured_at", image[1])
            for name, value in zip(FEATURES, image[2:6], strict=True):
                unit.set(name, value)
        unit.step(at, record.PERIOD)
        commands.append(unit.get_all("command"))
        if image is not None:
            state = unit.get("status", "reaction", "flags")
            offsets = [unit.get_all(name) for name in ("estimate", "delta_minus", "delta_plus")]
            answers.append(np.concatenate([state, *offsets]))
    duration = time.perf_counter() - begin
    expected = np.array(recording.ticks)[:, 6:]
    difference = np.abs(np.array(commands) - expected).max()
    print(f"loop, {profile}: {len(commands)} ticks in {duration:.1f} s, difference {difference}")
    np.testing.assert_array_equal(commands, expected)
    np.testing.assert_array_equal(answers, np.array(recording.images)[:, 6:18])


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_the_loop_of_two_degrees_of_freedom_finds_their_slack_as_in_python(
    profile: Profile, opened: Callable[..., Unit], builder: Builder
) -> None:
    """Late measurements, of which the half misses a degree of freedom."""
    recording = record.record_tip(profile)
    variables = fmpy.read_model_description(str(builder("loop", recording.config))).modelVariables
    units = {v.name: v.unit for v in variables}
    assert [units["measured_bend"], units["command_slide"]] == ["rad", "m"]
    unit = opened("loop", recording.config)
    images = {int(row[0]): row for row in recording.images}
    for k, (at, _, *numbers) in enumerate(recording.ticks):
        unit.set_all("reference", np.array(numbers[:2]))
        unit.set("reference_age", np.nan)
        if numbers[2]:
            unit.set("compensation", 0.5 if numbers[2] == 4 else 1.0)
        # Without any value it is no measurement.
        seen = images.get(k, np.full(4, np.nan))
        unit.set("has_measured", k in images or k % 100 == 50)
        unit.set("captured_at", seen[1])
        unit.set_all("measured", seen[2:4])
        unit.step(at)
        np.testing.assert_array_equal(unit.get_all("command"), numbers[3:])
        if k in images:
            state = unit.get("status", "reaction", "flags")
            offsets = [unit.get_all(name) for name in ("estimate", "delta_minus", "delta_plus")]
            np.testing.assert_array_equal(np.concatenate([state, *offsets]), seen[4:13])
    found = unit.get_all("delta_plus") - unit.get_all("delta_minus")
    print(f"loop, {profile}: slack found {found}, simulated {record.SLACK}")
    np.testing.assert_allclose(found, record.SLACK, rtol=0.02)


@pytest.mark.parametrize("profile", ["paper", "best"])
@pytest.mark.parametrize("robot", [CONFIG, axes(2, width_limit=1.2, delta_plus=[0.1, 0.3])])
def test_before_a_measurement_the_slack_is_the_expected_one(
    profile: Profile, robot: Config, opened: Callable[..., Unit]
) -> None:
    config = robot.replace(profile=profile)
    slack = HysteresisReduction(config).hysteresis
    if slack is None:  # profile paper starts with its configured offsets
        ends = np.array([(0.0, 0.1), (0.0, 0.3)] if config.dof else [(0.0, 0.0)] * 3).T
    else:
        ends = np.array([slack.centre - slack.half_width, slack.centre + slack.half_width])
    unit = opened("loop", config)
    for tick in range(3):
        if tick == 2:
            unit.reset()
        np.testing.assert_array_equal(
            [unit.get_all("delta_minus"), unit.get_all("delta_plus")], ends
        )
        assert np.isnan(unit.get_all("estimate")).all()
        assert list(Status)[int(unit.get("status")[0])] is Status.NO_MARKERS
        if tick == 0:
            unit.step(0.0)


def test_inputs_that_are_not_set_move_nothing(opened: Callable[..., Unit]) -> None:
    twin, loop = opened("twin", has_camera=False), opened("loop")
    start = twin.get_all("applied")
    for k in range(200):
        loop.step(k * PERIOD)
        twin.step(k * PERIOD)
    np.testing.assert_array_equal(twin.get_all("applied"), start)
    np.testing.assert_allclose(loop.get_all("command"), start, atol=1e-3)


def test_the_two_units_together_are_the_loop_on_the_twin(opened: Callable[..., Unit]) -> None:
    """Images of the one unit go to the other, commands back; 10 s."""
    plant, loop = opened("twin", seed=3), opened("loop")
    twin, reduction = Twin(CONFIG), HysteresisReduction(CONFIG)
    detector = MarkerDetector(CONFIG)
    sample = twin.reset()
    seen = 0
    for k in range(round(10 / PERIOD)):
        now, reference = k * PERIOD, motion(k * PERIOD)
        has_image = bool(plant.get("has_image")[0])
        loop.set_all("reference", reference)
        loop.set("reference_age", np.nan)
        for name in ("has_image", "captured_at", *FEATURES):
            (value,) = plant.get(name)
            loop.set(name, bool(value) if name == "has_image" else value)
        loop.step(now)
        plant.set_all("command", loop.get_all("command"))
        plant.step(now)

        command = reduction.step(reference, now)
        np.testing.assert_array_equal(loop.get_all("command"), command)
        assert has_image == (sample.frame is not None)
        if sample.frame is not None:
            features = detector.detect(sample.frame.image).features
            found = None if np.isnan(features).all() else features
            report = reduction.on_features(found, sample.frame.captured_at)
            assert list(Status)[int(loop.get("status")[0])] is report.status
            seen += report.status is Status.OK
        sample = twin.step(command)
    assert seen > 100


def test_a_larger_communication_step_is_several_control_periods(
    opened: Callable[..., Unit],
) -> None:
    one, ten = opened("twin", has_camera=False), opened("twin", has_camera=False)
    for k in range(100):
        for unit, ticks in ((one, 1), (ten, 10)):
            if k % ticks == 0:
                unit.set_all("command", motion(k // 10 * 0.05))
                unit.step(k * PERIOD, ticks * PERIOD)
    np.testing.assert_array_equal(ten.get_all("true"), one.get_all("true"))
    assert ten.get("time") == pytest.approx(0.5)


def test_reset_starts_again(opened: Callable[..., Unit]) -> None:
    unit = opened("twin", has_camera=False, seed=5)
    start = unit.get_all("true")
    unit.set_all("command", motion(1.0))
    for k in range(20):
        unit.step(k * PERIOD)
    assert (unit.get_all("true") != start).any()
    unit.reset()
    np.testing.assert_array_equal(unit.get_all("true"), start)
