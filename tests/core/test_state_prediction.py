"""State prediction for the marker detection, and the standard deviation of the state estimate."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from loop_at_rest import CONFIG, REST, Floats, loop_at_rest
from scipy.optimize import least_squares
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction, Status
from tautscope.loop.rig import Frame
from tautscope.loop.state_prediction import StatePrediction


class FakeDetector:
    """Returns a fixed detection; records the state predictions it is given."""

    def __init__(self, config: Config) -> None:
        self.predictions: list[StatePrediction] = []
        self.found = SimpleNamespace(
            features=np.zeros(4), covariance=np.eye(4), valid=False, found=(False, False)
        )

    def detect(
        self, image: object, predicted_features: None, prediction: StatePrediction
    ) -> SimpleNamespace:
        self.predictions.append(prediction)
        return self.found


def test_the_detector_receives_the_state_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    vision = SimpleNamespace(MarkerDetector=FakeDetector)
    monkeypatch.setitem(sys.modules, "tautscope.loop.vision", vision)
    loop = loop_at_rest()
    predicted, prior = loop.predicted_features(0.2), loop.predict_state(0.2)
    assert predicted is not None and prior is not None
    frame = Frame(np.zeros((576, 720, 3), np.uint8), captured_at=0.2, sequence=0)

    lost = loop.on_frame(frame)
    assert lost.status is Status.NO_MARKERS and lost.captured_at == 0.2
    detector = loop._detector
    assert isinstance(detector, FakeDetector) and lost.detection is detector.found
    np.testing.assert_array_equal(detector.predictions[0].state, prior.state)
    np.testing.assert_array_equal(detector.predictions[0].std, prior.std)

    detector.found = SimpleNamespace(
        features=predicted + 1.0, covariance=np.eye(4), valid=True, found=(True, True)
    )
    seen = loop.on_frame(frame)
    assert seen.status is Status.OK
    np.testing.assert_allclose(seen.innovation, 1.0, atol=1e-9)
    with pytest.raises(SignalError, match="captured_at"):
        loop.on_frame(replace(frame, captured_at=np.nan))


def test_the_prediction_follows_images_and_its_std_grows_with_travel() -> None:
    loop = loop_at_rest()
    before = loop.predict_state(0.3)
    assert before is not None
    np.testing.assert_array_equal(before.state, REST)
    start = [CONFIG[dof].start_deviation for dof in Dof]
    np.testing.assert_array_equal(before.std, start)

    displaced = REST + np.array([1e-3, 0.05, -0.03])
    seen = build_feature_model(CONFIG).predict(displaced)
    assert seen is not None
    report = loop.on_features(seen[0], 0.3)
    after = loop.predict_state(0.3)
    assert after is not None
    np.testing.assert_allclose(after.state, report.state_estimate)
    assert (after.std < before.std).all()

    for tick in range(20):
        loop.step(REST + np.array([1e-4 * (tick + 1), 0.0, 0.0]))
    later = loop.predict_state(0.55)
    assert later is not None
    assert later.std[0] > 1.5 * after.std[0]
    np.testing.assert_allclose(later.std[1:], after.std[1:])


def test_std_grows_without_markers_and_shrinks_with_them() -> None:
    loop = loop_at_rest()
    seen = build_feature_model(CONFIG).predict(REST)
    assert seen is not None
    loop.on_features(seen[0], 0.3)
    measured = loop.predict_state(0.3)
    assert measured is not None
    last = measured.std
    for frame in range(20):
        loop.step(REST)
        now = 0.31 + 0.01 * frame
        assert loop.on_features(None, now).status is Status.NO_MARKERS
        prediction = loop.predict_state(now)
        assert prediction is not None
        np.testing.assert_array_equal(prediction.state, measured.state)
        assert (prediction.std >= last).all()
        last = prediction.std
    start = np.array([CONFIG[dof].start_deviation for dof in Dof])
    assert (last >= 0.14 * start).all()
    assert (last < 0.5 * start).all()
    assert (last > 2 * measured.std).any()
    loop.on_features(seen[0], 0.51)
    again = loop.predict_state(0.51)
    assert again is not None
    np.testing.assert_allclose(again.std, measured.std, rtol=0.1)


@pytest.mark.parametrize("lost", [0, 1])
def test_one_band_updates_the_state_with_status_partial(lost: int) -> None:
    loop = loop_at_rest()
    seen = build_feature_model(CONFIG).predict(REST)
    assert seen is not None
    features = seen[0].copy()
    features[2 * lost : 2 * lost + 2] = np.nan
    report = loop.on_features(features, 0.3)
    assert report.status is Status.PARTIAL
    assert 1 <= report.observable.sum() <= 2
    np.testing.assert_allclose(report.state_estimate, REST, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(report.state_deviation), ~report.observable)
    with pytest.raises(SignalError, match="features"):
        loop.on_features([np.nan] * 4, 0.31)


def test_state_std_is_the_covariance_through_the_pseudo_inverse() -> None:
    loop = loop_at_rest()
    prediction = build_feature_model(CONFIG).predict(REST)
    assert prediction is not None
    features, matrix = prediction
    root = np.random.default_rng(0).normal(size=(4, 4))
    covariance = root @ root.T
    report = loop._update(features, covariance, 0.3)
    inverse = np.linalg.pinv(matrix, rcond=1e-15)
    expected = np.sqrt(np.diag(inverse @ covariance @ inverse.T))
    np.testing.assert_allclose(report.state_deviation, expected, rtol=1e-8)


def test_std_of_best_shrinks_with_images_at_rest() -> None:
    """Images every 40 ms show the predicted state, after a motion of 1 s."""
    config = CONFIG.replace(profile="best")
    loop, model = HysteresisReduction(config), build_feature_model(config)
    period = config.control.period
    found: list[Floats] = []
    for tick in range(600):
        moved = min(tick * period, 1.0) * np.array([5e-3, 0.5, 0.2])
        loop.step(np.asarray(REST) + moved, tick * period)
        if tick % 8 == 7:
            prediction = loop.predict_state(tick * period)
            seen = model.predict(loop.predicted_state)
            assert prediction is not None and seen is not None
            found.append(prediction.std)
            loop.on_features(seen[0], tick * period)
    std = np.array(found)
    assert np.all(np.diff(std[30:], axis=0) <= 0.0), std[30:]
    assert np.all(std[-1] < std[30]) and np.all(std[30] < 0.5 * std[0])


@pytest.mark.parametrize("seed", range(5))
def test_the_first_estimate_of_best_is_that_of_scipys_least_squares(seed: int) -> None:
    """With a prior far wider than the image's accuracy and an exact model."""
    rng = np.random.default_rng(seed)
    config = CONFIG.replace(
        profile="best",
        **{
            "estimation.shape_deviation": 0.0,
            "estimation.image_deviation": 0.0,
            "estimation.misfit_deviation": 0.0,
            "estimation.outlier_distance": 1e6,
            "safety.unusual": ["estimation.outlier_distance"],
            "safety.off": ["innovation"],
        },
        **{f"{dof.label}.start_deviation": 5 * CONFIG[dof].start_deviation for dof in Dof},
    )
    model = build_feature_model(config)
    root = rng.normal(0.0, 0.1, (4, 4))
    covariance = root @ root.T + 0.01 * np.eye(4)
    truth = REST + np.array([2e-3, 0.2, 0.1]) * rng.uniform(-1, 1, 3)
    shown = model.predict(truth)
    assert shown is not None
    measured = shown[0] + rng.multivariate_normal(np.zeros(4), covariance)
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))

    def residual(state: Floats) -> Floats:
        prediction = model.predict(state)
        assert prediction is not None
        return whitener @ (measured - prediction[0])

    expected = least_squares(residual, REST, x_scale=[1e-3, 0.1, 0.1], xtol=1e-15, ftol=1e-15)
    std = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    report = loop_at_rest(config=config)._update(measured, covariance, 0.3)
    difference = (report.state_estimate - expected.x) / std
    assert np.all(np.abs(difference) < 0.05), f"seed {seed}: {difference}"
    np.testing.assert_allclose(report.state_deviation, std, rtol=0.02, err_msg=f"seed {seed}")
