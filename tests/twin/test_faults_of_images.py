"""Faults of the camera: what it says, when it comes, and pictures."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from failing import (
    CENTRE,
    CONFIG,
    DURATION,
    EVERY,
    PERIOD,
    SEED,
    START,
    SeenTwin,
    fault,
    frames,
    run,
)
from tautscope import Twin
from tautscope.errors import FieldError
from tautscope.loop.construction import build_feature_model
from tautscope.twin.fault_frames import IMAGES
from tautscope.twin.faults import FaultyRig


def seen(name, **changes):
    """(time, features told, features true) while the fault lasts; before and after is checked."""
    inside = []
    for time, frame in frames(run(fault(name, **changes))):
        if START - 1e-9 <= time < START + DURATION - 1e-9:
            inside.append((time, frame.features, frame.true_features))
        else:
            np.testing.assert_array_equal(frame.features, frame.true_features, str(time))
    assert inside
    return [np.array(column) for column in zip(*inside, strict=True)]


def test_swapped_merged_mirrored_turned_zoomed():
    _, told, true = seen("swapped")
    np.testing.assert_array_equal(told, true[:, [2, 3, 0, 1]])
    _, told, true = seen("merged")
    np.testing.assert_allclose(told[:, :2], (true[:, :2] + true[:, 2:]) / 2)
    np.testing.assert_array_equal(told[:, :2], told[:, 2:])
    width, height = CONFIG.camera.width, CONFIG.camera.height
    _, told, true = seen("mirrored")
    np.testing.assert_allclose(told + true * [1, -1, 1, -1], [[width - 1, 0] * 2] * len(told))
    _, told, true = seen("turned")
    np.testing.assert_allclose(told + true, [[width - 1, height - 1] * 2] * len(told))
    _, told, true = seen("zoomed", severity=0.5)
    centre = np.tile([width / 2, height / 2], 2)
    np.testing.assert_allclose(told - centre, 0.5 * (true - centre))


def test_swapped_some_and_outliers_some_spare_the_others():
    _, told, true = seen("swapped_some", severity=3.0)
    wrong = (told != true).any(axis=1)
    assert wrong.sum() == math.ceil(len(wrong) / 3)
    assert wrong[0]
    assert not wrong[1]
    _, told, true = seen("outliers_some")
    assert list((told != true).any(axis=1)[:6]) == [True, False, False] * 2


def test_frozen_repeats_to_the_bit_and_frozen_noisy_nearly():
    _, told, true = seen("frozen")
    np.testing.assert_array_equal(told, np.tile(true[0], (len(told), 1)))
    _, told, true = seen("frozen_noisy")
    assert len(np.unique(told, axis=0)) == len(told)
    assert np.abs(told - true[0]).max() < 1.5, "px, noise of 0.2"
    _, told, true = seen("frozen_some", severity=4.0)
    np.testing.assert_array_equal(told, true[np.arange(len(true)) // 4 * 4])


def test_lost_bands_are_nan_and_the_other_is_as_it_is():
    for name, gone in (("band_a_lost", [0, 1]), ("band_b_lost", [2, 3]), ("bands_lost", range(4))):
        _, told, true = seen(name)
        assert np.isnan(told[:, gone]).all()
        kept = [i for i in range(4) if i not in gone]
        np.testing.assert_array_equal(told[:, kept], true[:, kept])
    time, told, _ = seen("bands_some", severity=0.1)
    lost = np.isnan(told).all(axis=1)
    np.testing.assert_array_equal(lost, ((time - START) / 0.1).astype(int) % 2 == 0)
    assert not np.isfinite(seen("not_finite")[1]).all(axis=1).any()


def test_random_is_anywhere_in_the_picture_and_elsewhere_is_one_spot():
    _, told, _ = seen("random")
    size = np.tile([CONFIG.camera.width, CONFIG.camera.height], 2)
    assert ((told >= 0) & (told < size)).all()
    assert len(np.unique(told, axis=0)) == len(told)
    _, told, true = seen("band_elsewhere")
    assert len(np.unique(told[:, 2:], axis=0)) == 1
    np.testing.assert_array_equal(told[:, :2], true[:, :2])


@pytest.mark.parametrize("name", ["biased", "outlier", "drifting", "outliers"])
def test_millimetres_are_those_of_the_instrument(name):
    """Against the loop's model, which the twin does not know and which sees the near side."""
    step = np.array([1e-4, 0, 0])
    model = build_feature_model(CONFIG)
    ahead = model.predict(CENTRE + step)[0] - model.predict(CENTRE - step)[0]
    direction = ahead / (2 * step[0])
    twin = SeenTwin()
    rig = FaultyRig(twin, (fault(name, severity=3.0 if name != "outlier" else 20.0),), SEED)
    rig.reset()
    off = []
    while twin.time < START + DURATION - 0.01:
        sample = rig.step(CENTRE)
        if sample.frame is not None and sample.time >= START:
            off.append((sample.frame.features - sample.frame.true_features, sample.time - START))
    moved = np.array([each @ direction / (direction @ direction) for each, _ in off])
    across = [each - move * direction for (each, _), move in zip(off, moved, strict=True)]
    assert np.abs(across).max() < 0.1 * np.abs(direction).max() * np.abs(moved).max()
    expected = {
        "biased": 3e-3 + 0 * moved,
        "outlier": np.array([20e-3] + [0.0] * (len(moved) - 1)),
        "drifting": 3e-3 * np.array([since for _, since in off]),
        "outliers": np.minimum(np.abs(moved), 3e-3),
    }[name]
    np.testing.assert_allclose(np.abs(moved), expected, rtol=0.06, atol=1e-5)


def arrivals(name, **changes):
    """(arrived, captured, frame) of what was captured or came while the fault lasted."""
    found = frames(run(fault(name, **changes), seconds=1.6))
    return [(time, frame.captured_at, frame) for time, frame in found if time >= START]


def test_late_frames_keep_their_true_time_unless_nobody_knows():
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


def test_jitter_moves_arrivals_and_stamp_jitter_times():
    late = [time - captured for time, captured, _ in arrivals("jitter", severity=0.2)]
    assert min(late) >= -1e-9
    assert 0.05 < max(late) <= 0.2 + 1.01 * PERIOD
    off = [captured - time for time, captured, _ in arrivals("stamp_jitter", severity=0.1)]
    assert -0.1 <= min(off) < -0.02
    assert max(off) <= 1e-9, "no frame from the future"


def test_duplicates_come_twice_and_reordered_after_their_successors():
    times = [captured for _, captured, _ in arrivals("duplicate")]
    assert sum(a == b for a, b in pairwise(times)) >= 7
    times = [captured for _, captured, _ in arrivals("reordered")]
    assert sum(b < a for a, b in pairwise(times)) >= 3
    assert len(set(times)) == len(times)


def test_frames_that_do_not_come():
    whole = len(arrivals("ok"))
    inside = round(DURATION / (EVERY * PERIOD))
    assert len(arrivals("camera_off")) == whole - inside
    assert whole - inside < len(arrivals("dropped", severity=0.5)) < whole
    slow = [time for time, _, _ in arrivals("slow_camera", severity=5.0) if time < START + DURATION]
    assert len(slow) == 2


def test_times_that_are_none():
    def stamped(name, **changes):
        return [(t, c) for t, c, _ in arrivals(name, **changes) if t < START + DURATION - 1e-9]

    assert all(c - t == pytest.approx(-1800) for t, c in stamped("stamp_hour", severity=-1800.0))
    assert all(math.isnan(c) for _, c in stamped("stamp_nan"))
    assert len({c for _, c in stamped("stamp_stuck")}) == 1
    times = stamped("stamp_slow", severity=0.5)
    assert all(c - START == pytest.approx(0.5 * (t - START)) for t, c in times)


@pytest.mark.parametrize("name", sorted(IMAGES))
def test_pictures(name):
    twin = Twin(CONFIG)
    rig = FaultyRig(twin, (fault(name, start=0.0),), SEED)
    plain = frames(run(rig=(bare := Twin(CONFIG)), twin=bare, seconds=0.25))
    spoilt = frames(run(rig=rig, twin=twin, seconds=0.25))
    assert len(spoilt) == len(plain) > 2
    for (_, got), (_, true) in zip(spoilt, plain, strict=True):
        np.testing.assert_array_equal(got.true_features, true.true_features)
        expected = {
            "mirrored": true.image[:, ::-1],
            "turned": true.image[::-1, ::-1],
            "frozen": plain[0][1].image,
            "bands_lost": np.zeros_like(true.image),
        }.get(name)
        if expected is None:
            assert abs(got.image.mean() - 127.5) < 1
        else:
            np.testing.assert_array_equal(got.image, expected)


def test_what_cannot_be_done_to_a_picture_is_refused():
    with pytest.raises(FieldError, match=r"faults\[1\]\.kind"):
        FaultyRig(Twin(CONFIG), (fault("late"), fault("swapped")), 0)
