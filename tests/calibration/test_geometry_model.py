"""The model of the geometry calibration: batches, rotations, derivatives."""

import numpy as np
import pytest
from play_model import play
from simulated_motion import actual, simulate, told
from tautscope import _core
from tautscope.calibration.geometry.model import Model
from tautscope.calibration.geometry.parameters import (
    INDEX,
    NAMES,
    PARAMETERS,
    estimated,
)
from tautscope.errors import ConfigError, FieldError, SignalError
from tautscope.loop.construction import build_feature_model

STATES = np.random.default_rng(0).uniform((0.01, -2, 0.2), (0.04, 2, 1.6), (50, 3))


def test_a_batch_is_predicted_as_its_states_are() -> None:
    model = build_feature_model(told())
    features, matrices = model.predict_all(STATES, np.zeros(len(STATES)))
    assert np.isfinite(features).mean() > 0.9
    for state, row, by_state in zip(STATES, features, matrices, strict=True):
        alone = model.predict(state)
        if alone is None:
            assert np.isnan(row).all() and np.isnan(by_state).all()
        else:
            np.testing.assert_array_equal(row, alone[0])
            np.testing.assert_array_equal(by_state, alone[1])
    with pytest.raises(SignalError, match="unevenness"):
        model.predict_all(STATES, np.zeros(3))


def test_an_uneven_section_displaces_both_bands_alike_and_a_straight_one_does_not() -> None:
    """A curvature that grows along the section: less displacement, more towards the end."""
    camera = _core.Camera(fx=100.0, fy=100.0, cx=0.0, cy=0.0, distortion=(0.0,) * 8)
    instrument = _core.Instrument(
        bending_length=0.02, marker_a=0.004, marker_b=0.016, radius=0.0, band_length=0.0
    )
    model = _core.FeatureModel(
        instrument, camera, translation=(0.0, 0.0, 0.1), rotation=(0.0, 0.0, 0.0)
    )
    uneven = np.array([0.0, 0.3])
    straight, _ = model.predict_all([[0.02, 0.0, 0.0]] * 2, uneven)
    np.testing.assert_allclose(straight[0], straight[1], atol=1e-12)
    # Integration of the curvature 1 + 0.3 (2 x - 1) in steps.
    bend, steps = 1.0, 20_000
    x = (np.arange(steps) + 0.5) / steps
    angle = bend * np.cumsum(1 + 0.3 * (2 * x - 1)) / steps
    end = 0.02 * np.array([np.sin(angle).mean(), np.cos(angle).mean()])
    bands = [end + d * np.array([np.sin(bend), np.cos(bend)]) for d in (0.004, 0.016)]
    expected = [100 * r / (0.1 + 0.02 + z) for r, z in bands]
    found, _ = model.predict_all([[0.02, 0.0, bend]], [0.3])
    np.testing.assert_allclose(found[0, [0, 2]], expected, atol=0.05)


def test_derivatives_are_those_of_differences() -> None:
    """By state and by parameter, with a step ten times as large as the model's own."""
    recording, states = simulate(duration=10.0)
    found = recording.found
    model = Model(told(), recording.with_bands(), None)
    active = np.ones(len(NAMES), np.bool_)
    z = np.random.default_rng(2).normal(0, 0.3, len(NAMES))
    whole = np.column_stack([states[found], np.full(found.sum(), 0.02)])
    predicted, by_state = model.features(z, whole)
    visible = np.isfinite(predicted).all(axis=1)
    for column, step in enumerate((1e-5, 1e-3, 1e-3, 1e-2)):
        shift = step * np.eye(4)[column]
        ahead, behind = (model.features(z, whole + way)[0] for way in (shift, -shift))
        numeric = (ahead - behind)[visible] / (2 * step)
        scale = np.abs(numeric).max()
        assert np.abs(by_state[visible, :, column] - numeric).max() < 5e-3 * scale
    by_parameters = model.by_parameters(z, whole, active)
    start = model.expected(z)

    def moved(z: np.ndarray) -> np.ndarray:
        """Features with states that follow their expectation."""
        tips = whole + model.expected(z) - start
        return model.features(z, tips)[0]

    for name in ("camera.focal", "instrument.bending_length", "unevenness", "gain bending"):
        step = 1e-2 * np.eye(len(NAMES))[INDEX[name]]
        numeric = (moved(z + step) - moved(z - step))[visible] / 2e-2
        difference = by_parameters[visible][:, :, INDEX[name]] - numeric
        assert np.abs(difference).max() < 0.02 * np.abs(numeric).max(), name


def test_the_hysteresis_of_a_dof_that_moves_alone_is_a_play() -> None:
    command = np.cumsum(np.random.default_rng(3).normal(0, 1e-3, 500))
    motors = np.zeros((500, 3))
    motors[:, 0] = command
    for shared in (0.0, 0.5, 1.0):
        hysteresis = _core.Hysteresis(
            half_width=(4e-3, 0.7, 0.5), centre=(1e-3, 0.0, 0.0), shared=shared, radius=1.75e-3
        )
        start = command[0] - 1e-3
        expected = play(command, 1e-3 - 4e-3, 1e-3 + 4e-3, start=start)
        tip = hysteresis.run(motors)
        np.testing.assert_allclose(tip[:, 0], expected, atol=1e-5)
        np.testing.assert_array_equal(tip[:, 1:], 0.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("half_width", (0.0, 1.0, 1.0)),
        ("centre", (np.nan, 0.0, 0.0)),
        ("shared", 1.5),
        ("radius", 0.0),
    ],
)
def test_a_hysteresis_refuses_bad_values(field: str, value: object) -> None:
    good = {"half_width": (1.0,) * 3, "centre": (0.0,) * 3, "shared": 0.5, "radius": 1e-3}
    with pytest.raises(ConfigError, match=field):
        _core.Hysteresis(**(good | {field: value}))


def test_the_free_directions_are_fixed() -> None:
    zeros = [INDEX["zero insertion"], INDEX["zero rotation"]]
    for intrinsics, count in (("none", 0), ("focal", 1), ("all", 5)):
        active = estimated(intrinsics, by_band_distance=False)
        assert not active[zeros].any()
        assert active[[INDEX[p.name] for p in PARAMETERS[9:14]]].sum() == count
    assert not estimated("focal", by_band_distance=True)[INDEX["instrument.marker_b"]]
    with pytest.raises(FieldError, match="intrinsics"):
        estimated("some", by_band_distance=False)


def test_the_actual_rig_is_at_the_differences_of_its_parameters() -> None:
    """The model at the true differences predicts what the actual configuration predicts."""
    config, rig = told(), actual()
    recording, _ = simulate(duration=5.0)
    model = Model(
        config,
        recording,
        None,
    )
    truth = np.zeros(len(NAMES))
    truth[0:3] = np.array((2e-3, -1.5e-3, 3e-3))
    truth[3:6] = (0.05, -0.04, 0.02)
    truth[INDEX["instrument.bending_length"]] = np.log(0.94)
    truth[INDEX["instrument.marker_a"]], truth[INDEX["instrument.marker_b"]] = 0.5e-3, -0.4e-3
    truth[INDEX["camera.focal"]] = np.log(1.02)
    z = truth / model.prior_std
    whole = np.column_stack([STATES, np.zeros(len(STATES))])
    expected, _ = build_feature_model(rig).predict_all(STATES, np.zeros(len(STATES)))
    np.testing.assert_allclose(model.features(z, whole)[0], expected, atol=1e-9)


def test_one_factor_of_all_lengths_and_of_insertion_changes_no_feature() -> None:
    """Whatever the motors let expect: a deviation from it says nothing about the scale."""
    recording, states = simulate(duration=10.0)
    config = told()
    thin = ("instrument.diameter", "instrument.band_length")  # they are not estimated
    config = config.replace(**dict.fromkeys(thin, 1e-5) | {"safety.unusual": thin})
    model = Model(config, recording, None)
    z, active = np.zeros(len(NAMES)), np.ones(len(NAMES), dtype=bool)
    states = np.column_stack([states + np.array([2e-3, 0.1, -0.1]), np.zeros(len(states))])
    by_z = model.by_parameters(z, states, active)
    instrument = config.instrument
    change = {
        **dict(zip(NAMES[:3], config.camera.camera_from_guide.translation, strict=True)),
        "instrument.bending_length": 1.0,  # a logarithm
        "instrument.marker_a": instrument.marker_a,
        "instrument.marker_b": instrument.marker_b,
        "gain insertion": 1.0,
        "zero insertion": recording.motors[0, 0],
    }
    by_scale = sum(
        by_z[:, :, INDEX[name]] * size / model.prior_std[INDEX[name]]
        for name, size in change.items()
    )
    alone = by_z[:, :, INDEX["gain insertion"]] / model.prior_std[INDEX["gain insertion"]]
    is_visible = np.isfinite(by_scale).all(axis=1)
    assert is_visible.sum() > 50
    assert np.abs(by_scale[is_visible]).max() < 0.01 * np.abs(alone[is_visible]).max()
