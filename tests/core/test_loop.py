"""HysteresisReduction on three simulated plays in the images of an ideal camera.

Profile `paper` unless stated; test_adaptive_loop.py has `best`.
"""

from dataclasses import fields

import numpy as np
import pytest
from loop_at_rest import CONFIG, REST, Floats, loop_at_rest
from tautscope import _core
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction, Report, Status

WIDTHS = np.array([10e-3, 1.8, 1.1])
AMPLITUDES = np.array([15e-3, 2.0, 1.1])
PERIOD = CONFIG.control.period


class Plays:
    """An instrument of three plays with a fixed delay of the images; independent of the package."""

    def __init__(self, delay: int, noise: float = 0.0, seed: int = 0) -> None:
        self.tip = REST.copy()
        self.delay, self.noise = delay, noise
        self.rng = np.random.default_rng(seed)
        self.past: list[Floats] = []

    def step(self, command: Floats) -> None:
        self.tip = np.clip(self.tip, command - WIDTHS / 2, command + WIDTHS / 2)
        self.past.append(self.tip)

    def newest_image(self) -> tuple[int, Floats] | None:
        """Tick of capture and features of the image that arrives now."""
        tick = len(self.past) - 1 - self.delay
        if tick < 0 or tick % 8:
            return None
        prediction = build_feature_model(CONFIG).predict(self.past[tick])
        assert prediction is not None
        return tick, prediction[0] + self.rng.normal(0.0, self.noise, 4)


def run(compensate: bool, delay: int, noise: float = 0.0, seed: int = 0) -> dict[str, Floats]:
    """Reference, command and tip over five periods per DOF in succession."""
    loop, plays = HysteresisReduction(CONFIG, compensate), Plays(delay, noise, seed)
    traces: dict[str, list[Floats]] = {"reference": [], "command": [], "tip": []}
    ticks = 1000
    for dof in range(3):
        for tick in range(5 * ticks):
            reference = REST.copy()
            reference[dof] += AMPLITUDES[dof] * np.sin(2 * np.pi * tick / ticks)
            command = loop.step(reference)
            plays.step(command)
            image = plays.newest_image()
            if image is not None:
                loop.on_features(image[1], image[0] * PERIOD)
            for name, value in zip(traces, (reference, command, plays.tip), strict=True):
                traces[name].append(value)
    return {name: np.array(values) for name, values in traces.items()}


def width(traces: dict[str, Floats], dof: int, against: str) -> float:
    """Width of the last hysteresis loop of a DOF at the middle of its output."""
    last = slice(dof * 5000 + 4000, dof * 5000 + 5000)
    x, y = traces[against][last, dof], traces["tip"][last, dof]
    middle = (y.max() + y.min()) / 2
    crossing = np.flatnonzero(np.diff(y > middle))
    rising, falling = (crossing[np.diff(y)[crossing] * sign > 0] for sign in (1, -1))
    return float(x[rising].mean() - x[falling].mean())


@pytest.mark.parametrize("delay", [0, 16])
def test_the_loop_compensates_the_slack(delay: int) -> None:
    compensated, uncompensated = run(True, delay), run(False, delay)
    for dof in range(3):
        before, after = width(uncompensated, dof, "command"), width(compensated, dof, "reference")
        assert before == pytest.approx(WIDTHS[dof], rel=0.05), f"DOF {dof}"
        assert 1 - after / before > 0.7, f"DOF {dof}: {before} to {after}"


@pytest.mark.parametrize("seed", range(3))
def test_the_loop_compensates_the_slack_with_noise(seed: int) -> None:
    traces = run(True, 16, noise=0.3, seed=seed)
    for dof in range(3):
        assert width(traces, dof, "reference") < 0.35 * WIDTHS[dof], f"seed {seed}, DOF {dof}"


def test_without_compensation_the_command_is_the_reference() -> None:
    traces = run(False, 16)
    np.testing.assert_allclose(traces["command"], traces["reference"], atol=1e-12)


def test_the_report_contains_intermediate_results() -> None:
    loop = loop_at_rest()
    predicted = loop.predicted_features(0.2)
    assert predicted is not None
    report = loop.on_features(predicted + np.array([1.0, 0.0, -1.0, 0.5]), 0.2)
    assert report.status is Status.OK and report.observable.all() and report.detection is None
    np.testing.assert_allclose(report.innovation, [1.0, 0.0, -1.0, 0.5], atol=1e-9)
    np.testing.assert_array_equal(report.predicted_features, predicted)
    np.testing.assert_array_equal(report.predicted_state, REST)
    features, matrix = build_feature_model(CONFIG).predict(REST) or (None, None)
    assert features is not None and matrix is not None
    step = np.linalg.pinv(matrix) @ report.innovation
    np.testing.assert_allclose(report.state_estimate, REST + step, rtol=1e-9)
    shapes = {
        field.name: value.shape
        for field in fields(Report)
        if isinstance(value := getattr(report, field.name), np.ndarray)
    }
    four = {"predicted_features", "innovation"}
    assert shapes == {name: (4,) if name in four else (3,) for name in shapes}
    assert len(shapes) == 9 and len(report.triggers) == 3


def test_unused_frames_report_the_reason() -> None:
    loop = loop_at_rest()
    seen = loop.predicted_features(0.3)
    assert seen is not None
    assert loop.on_features(seen, 0.3).status is Status.OK
    assert loop.on_features(seen, 0.3).status is Status.DUPLICATE
    assert loop.on_features(seen, 0.1).status is Status.DUPLICATE
    assert loop.on_features(None, 0.4).status is Status.NO_MARKERS
    assert loop.on_features(seen, 0.4).status is Status.OK, (
        "a frame without markers does not count as used"
    )
    assert loop.on_features(seen, 9.0).status is Status.STALE
    assert loop.predicted_features(9.0) is None
    lost = loop.on_features(None, 0.45)
    assert np.isnan(lost.innovation).all() and not lost.observable.any()
    np.testing.assert_array_equal(lost.state_estimate, lost.predicted_state)
    assert HysteresisReduction(CONFIG).on_features(seen, 0.0).status is Status.STALE


def test_after_the_clock_jumps_back_frames_are_used_again() -> None:
    loop = loop_at_rest()
    seen = loop.predicted_features(0.4)
    assert loop.on_features(seen, 0.4).status is Status.OK
    loop.step(REST, time=0.1)
    assert loop.on_features(seen, 0.1).status is Status.OK


def test_a_held_dof_updates_no_offset() -> None:
    strict = CONFIG.replace(
        **{
            "rotation.observable_deviation": 1e-6,
            "safety.unusual": ["rotation.observable_deviation"],
        }
    )
    loop = HysteresisReduction(strict)
    for tick in range(2000):
        wave = np.sin(2 * np.pi * tick / 1000)
        loop.step(REST + 0.25 * AMPLITUDES * wave)
        if tick % 8:
            continue
        features = build_feature_model(strict).predict(REST)
        assert features is not None
        report = loop.on_features(features[0], tick * PERIOD)
        assert report.status is Status.HELD
        assert list(report.observable) == [True, False, True]
        assert report.state_estimate[1] == report.predicted_state[1]
        assert report.triggers[1] == (None, None)
    assert loop.delta_minus[1] == loop.delta_plus[1] == 0.0
    assert (loop.delta_plus - loop.delta_minus)[[0, 2]].min() > 0.0


def test_the_command_is_looked_up_at_the_capture_time() -> None:
    """A moving tip without slack: any misalignment in time would appear as width."""
    loop = HysteresisReduction(CONFIG)
    model = build_feature_model(CONFIG)
    references = [REST + 0.4 * AMPLITUDES * np.sin(2 * np.pi * tick / 500) for tick in range(1500)]
    for tick, reference in enumerate(references):
        loop.step(reference)
        captured = tick - 16
        if captured >= 0 and captured % 8 == 0:
            # Between two ticks, to test the interpolation of the history.
            tip = (references[captured] + references[captured + 1]) / 2
            prediction = model.predict(tip)
            assert prediction is not None
            loop.on_features(prediction[0], (captured + 0.5) * PERIOD)
    assert ((loop.delta_plus - loop.delta_minus) < 1e-3 * WIDTHS).all()


@pytest.mark.parametrize(
    "reference", [[0.0, np.nan, 0.0], [0.0, 1.0], "abc", None, [[0.0, 0.0, 0.0]], np.inf]
)
def test_an_invalid_reference_is_named_and_ignored(reference: object) -> None:
    loop = loop_at_rest()
    before = loop.step(REST)
    with pytest.raises(SignalError) as error:
        loop.step(reference)  # type: ignore[arg-type]
    assert error.value.field == "reference"
    np.testing.assert_array_equal(loop.step(REST), before)


def test_invalid_features_and_times_are_named() -> None:
    loop = loop_at_rest()
    with pytest.raises(SignalError, match="features"):
        loop.on_features([1.0, 2.0, np.nan, 4.0], 0.1)
    with pytest.raises(SignalError, match="captured_at"):
        loop.on_features(None, np.nan)
    with pytest.raises(SignalError, match="time"):
        loop.step(REST, time=np.inf)


def test_blocks_name_the_invalid_setting() -> None:
    with pytest.raises(ConfigError) as error:
        _core.Play(delta_minus=1.0, delta_plus=0.0)
    assert (error.value.field, error.value.value) == ("delta_minus", 1.0)
    with pytest.raises(ConfigError, match="free_gain"):
        _core.Compensator(free_gain=0.5, gain_limit=5.0, delta_minus=0.0, delta_plus=0.0)
    with pytest.raises(ConfigError, match="bending_length"):
        _core.Instrument(
            bending_length=-1.0, marker_a=0.0, marker_b=0.0, radius=0.0, band_length=0.0
        )
    with pytest.raises(ConfigError, match="fx"):
        _core.Camera(fx=0.0, fy=1.0, cx=0.0, cy=0.0, distortion=(0.0,) * 8)


def test_run_equals_step_by_step() -> None:
    from tautscope.loop.construction import build_loop

    references = REST + 0.1 * np.sin(np.arange(300.0))[:, None] * AMPLITUDES
    times = np.arange(300) * PERIOD
    one, other = build_loop(CONFIG), HysteresisReduction(CONFIG)
    np.testing.assert_array_equal(
        one.run(references, times), [other.step(reference) for reference in references]
    )
