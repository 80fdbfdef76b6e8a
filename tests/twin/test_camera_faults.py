"""Faults of the camera: features, arrival times, time stamps, images."""

import math
from itertools import pairwise

import numpy as np
import pytest
from faulty_runs import (
    CENTRE,
    CONFIG,
    DURATION,
    PERIOD,
    SEED,
    START,
    TICKS_PER_FRAME,
    FeatureTwin,
    fault,
    frames,
    run,
)
from tautscope import Twin
from tautscope.errors import FieldError
from tautscope.loop.construction import build_feature_model
from tautscope.twin.fault_frames import IMAGE_FAULTS
from tautscope.twin.faults import FaultyRig


def measured(name, **changes):
    """Time, measured and true features during the fault; outside it both must be equal."""
    during = []
    for time, frame in frames(run(fault(name, **changes))):
        if START - 1e-9 <= time < START + DURATION - 1e-9:
            during.append((time, frame.features, frame.true_features))
        else:
            np.testing.assert_array_equal(frame.features, frame.true_features, str(time))
    assert during
    return [np.array(column) for column in zip(*during, strict=True)]


def test_swapped_merged_mirrored_turned_zoomed():
    _, features, true = measured("swapped")
    np.testing.assert_array_equal(features, true[:, [2, 3, 0, 1]])
    _, features, true = measured("merged")
    np.testing.assert_allclose(features[:, :2], (true[:, :2] + true[:, 2:]) / 2)
    np.testing.assert_array_equal(features[:, :2], features[:, 2:])
    width, height = CONFIG.camera.width, CONFIG.camera.height
    _, features, true = measured("mirrored")
    np.testing.assert_allclose(
        features + true * [1, -1, 1, -1], [[width - 1, 0] * 2] * len(features)
    )
    _, features, true = measured("turned")
    np.testing.assert_allclose(features + true, [[width - 1, height - 1] * 2] * len(features))
    _, features, true = measured("zoomed", severity=0.5)
    centre = np.tile([width / 2, height / 2], 2)
    np.testing.assert_allclose(features - centre, 0.5 * (true - centre))


def test_intermittent_feature_faults_leave_other_frames_unchanged():
    _, features, true = measured("swapped_some", severity=3.0)
    wrong = (features != true).any(axis=1)
    assert wrong.sum() == math.ceil(len(wrong) / 3)
    assert wrong[0]
    assert not wrong[1]
    _, features, true = measured("outliers_some")
    assert list((features != true).any(axis=1)[:6]) == [True, False, False] * 2


def test_frozen_features_repeat_exactly_or_within_their_noise():
    _, features, true = measured("frozen")
    np.testing.assert_array_equal(features, np.tile(true[0], (len(features), 1)))
    _, features, true = measured("frozen_noisy")
    assert len(np.unique(features, axis=0)) == len(features)
    assert np.abs(features - true[0]).max() < 1.5, "px, noise of 0.2"
    _, features, true = measured("frozen_some", severity=4.0)
    np.testing.assert_array_equal(features, true[np.arange(len(true)) // 4 * 4])


def test_lost_bands_are_nan_and_others_unchanged():
    for name, gone in (("band_a_lost", [0, 1]), ("band_b_lost", [2, 3]), ("bands_lost", range(4))):
        _, features, true = measured(name)
        assert np.isnan(features[:, gone]).all()
        kept = [i for i in range(4) if i not in gone]
        np.testing.assert_array_equal(features[:, kept], true[:, kept])
    time, features, _ = measured("bands_some", severity=0.1)
    lost = np.isnan(features).all(axis=1)
    np.testing.assert_array_equal(lost, ((time - START) / 0.1).astype(int) % 2 == 0)
    assert not np.isfinite(measured("not_finite")[1]).all(axis=1).any()


def test_random_features_cover_the_image_and_band_elsewhere_is_one_spot():
    _, features, _ = measured("random")
    size = np.tile([CONFIG.camera.width, CONFIG.camera.height], 2)
    assert ((features >= 0) & (features < size)).all()
    assert len(np.unique(features, axis=0)) == len(features)
    _, features, true = measured("band_elsewhere")
    assert len(np.unique(features[:, 2:], axis=0)) == 1
    np.testing.assert_array_equal(features[:, :2], true[:, :2])


@pytest.mark.parametrize("name", ["biased", "outlier", "drifting", "outliers"])
def test_shifts_match_the_image_jacobian_of_insertion(name):
    """Compared with the loop's feature model, which the twin does not use."""
    step = np.array([1e-4, 0, 0])
    model = build_feature_model(CONFIG)
    ahead = model.predict(CENTRE + step)[0] - model.predict(CENTRE - step)[0]
    direction = ahead / (2 * step[0])
    twin = FeatureTwin()
    rig = FaultyRig(twin, (fault(name, severity=3.0 if name != "outlier" else 20.0),), SEED)
    rig.reset()
    error = []
    while twin.time < START + DURATION - 0.01:
        sample = rig.step(CENTRE)
        if sample.frame is not None and sample.time >= START:
            error.append((sample.frame.features - sample.frame.true_features, sample.time - START))
    moved = np.array([each @ direction / (direction @ direction) for each, _ in error])
    across = [each - move * direction for (each, _), move in zip(error, moved, strict=True)]
    assert np.abs(across).max() < 0.1 * np.abs(direction).max() * np.abs(moved).max()
    expected = {
        "biased": 3e-3 + 0 * moved,
        "outlier": np.array([20e-3] + [0.0] * (len(moved) - 1)),
        "drifting": 3e-3 * np.array([since for _, since in error]),
        "outliers": np.minimum(np.abs(moved), 3e-3),
    }[name]
    np.testing.assert_allclose(np.abs(moved), expected, rtol=0.06, atol=1e-5)


def arrivals(name, **changes):
    """(arrived, captured, frame) of every frame from the start of the fault on."""
    found = frames(run(fault(name, **changes), seconds=1.6))
    return [(time, frame.captured_at, frame) for time, frame in found if time >= START]


def test_late_frames_keep_their_stamps_unless_the_delay_is_unknown():
    for time, captured, frame in arrivals("late", severity=0.2):
        true = frame.sequence * PERIOD - PERIOD
        assert captured == pytest.approx(true)
        if START <= true < START + DURATION:
            assert time - true == pytest.approx(0.2, abs=1.01 * PERIOD)
    for time, captured, frame in arrivals("late_unknown", severity=0.2):
        true = frame.sequence * PERIOD - PERIOD
        if START <= true < START + DURATION:
            assert captured - true == pytest.approx(0.2)
            assert time >= captured - 1e-9


def test_jitter_delays_arrivals_and_stamp_jitter_changes_stamps():
    late = [time - captured for time, captured, _ in arrivals("jitter", severity=0.2)]
    assert min(late) >= -1e-9
    assert 0.05 < max(late) <= 0.2 + 1.01 * PERIOD
    error = [captured - time for time, captured, _ in arrivals("stamp_jitter", severity=0.1)]
    assert -0.1 <= min(error) < -0.02
    assert max(error) <= 1e-9, "no frame from the future"


def test_duplicates_arrive_twice_and_reordered_frames_late():
    times = [captured for _, captured, _ in arrivals("duplicate")]
    assert sum(a == b for a, b in pairwise(times)) >= 7
    times = [captured for _, captured, _ in arrivals("reordered")]
    assert sum(b < a for a, b in pairwise(times)) >= 3
    assert len(set(times)) == len(times)


def test_lost_frames():
    whole = len(arrivals("ok"))
    during = round(DURATION / (TICKS_PER_FRAME * PERIOD))
    assert len(arrivals("camera_off")) == whole - during
    assert whole - during < len(arrivals("dropped", severity=0.5)) < whole
    slow = [time for time, _, _ in arrivals("slow_camera", severity=5.0) if time < START + DURATION]
    assert len(slow) == 2


def test_wrong_time_stamps():
    def stamped(name, **changes):
        return [(t, c) for t, c, _ in arrivals(name, **changes) if t < START + DURATION - 1e-9]

    assert all(c - t == pytest.approx(-1800) for t, c in stamped("stamp_hour", severity=-1800.0))
    assert all(math.isnan(c) for _, c in stamped("stamp_nan"))
    assert len({c for _, c in stamped("stamp_stuck")}) == 1
    times = stamped("stamp_slow", severity=0.5)
    assert all(c - START == pytest.approx(0.5 * (t - START)) for t, c in times)


@pytest.mark.parametrize("name", sorted(IMAGE_FAULTS))
def test_image_faults(name):
    twin = Twin(CONFIG)
    rig = FaultyRig(twin, (fault(name, start=0.0),), SEED)
    plain = frames(run(rig=(bare := Twin(CONFIG)), twin=bare, seconds=0.25))
    faulty = frames(run(rig=rig, twin=twin, seconds=0.25))
    assert len(faulty) == len(plain) > 2
    for (_, actual), (_, true) in zip(faulty, plain, strict=True):
        np.testing.assert_array_equal(actual.true_features, true.true_features)
        expected = {
            "mirrored": true.image[:, ::-1],
            "turned": true.image[::-1, ::-1],
            "frozen": plain[0][1].image,
            "bands_lost": np.zeros_like(true.image),
        }.get(name)
        if expected is None:
            assert abs(actual.image.mean() - 127.5) < 1
        else:
            np.testing.assert_array_equal(actual.image, expected)


def test_feature_faults_without_an_image_model_are_rejected():
    with pytest.raises(FieldError, match=r"faults\[1\]\.kind"):
        FaultyRig(Twin(CONFIG), (fault("late"), fault("swapped")), 0)
