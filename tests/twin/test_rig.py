"""The simulated rig: clock, frames, latency, errors, reproducibility."""

import hashlib

import numpy as np
import pytest
from tautscope import Rig, Twin, load_config
from tautscope.errors import ConfigError, SignalError

POSTURE = np.array([0.025, 0.0, 0.9])


def samples(seconds, *, images=True, **changes):
    config = load_config().replace(**changes)
    rig = Twin(config, images=images)
    collected = [rig.reset()]
    for k in range(round(seconds / rig.control_period)):
        wobble = np.array([0.005, 0.3, 0.2]) * np.sin(2 * np.pi * k * rig.control_period)
        collected.append(rig.step(POSTURE + wobble))
    rig.close()
    return collected


def frames(collected):
    return [(sample.time, sample.frame) for sample in collected if sample.frame is not None]


def digest(collected):
    sha = hashlib.sha256()
    for sample in collected:
        sha.update(np.array(sample.time).tobytes() + sample.applied.tobytes())
        sha.update(sample.true_state.tobytes())
        if sample.frame is not None:
            sha.update(sample.frame.image.tobytes() + sample.frame.true_features.tobytes())
    return sha.hexdigest()


def test_it_is_a_rig():
    assert isinstance(Twin(load_config(), images=False), Rig)


def test_same_seed_same_bytes_other_seed_others():
    runs = [digest(samples(0.5, **{"twin.seed": seed})) for seed in (3, 3, 4)]
    assert runs[0] == runs[1] != runs[2], "seeds 3, 3, 4"


def test_reset_starts_the_same_instrument_again():
    rig = Twin(load_config(), images=False)
    first = rig.reset().true_state
    for _ in range(50):
        rig.step(POSTURE + 0.01)
    again = rig.reset()
    assert again.time == 0
    np.testing.assert_array_equal(again.true_state, first)


def test_frames_come_at_the_frame_rate_and_arrive_late_within_the_jitter():
    arrived = frames(samples(2.0))
    captured = np.array([frame.captured_at for _, frame in arrived])
    assert [frame.sequence for _, frame in arrived] == list(range(len(arrived)))
    np.testing.assert_allclose(np.diff(captured), 0.04, atol=1e-9)
    age = np.array([time for time, _ in arrived]) - captured
    # A frame is reported at the next control tick.
    assert age.min() >= 0.07 - 1e-9
    assert age.max() <= 0.09 + 0.005 + 1e-9
    assert np.ptp(age) > 0.005


def test_without_latency_a_frame_arrives_at_once():
    arrived = frames(samples(0.2, **{"twin.latency": 0.0, "twin.latency_jitter": 0.0}))
    assert [time for time, _ in arrived] == [frame.captured_at for _, frame in arrived]


def test_a_frame_shows_the_state_at_its_capture_not_at_its_arrival():
    collected = samples(1.0, **{"twin.image_noise": 0.0})
    by_time = {round(sample.time, 6): sample.true_state for sample in collected}
    moved = [
        (frame.true_features, by_time[round(frame.captured_at, 6)], by_time[round(time, 6)])
        for time, frame in frames(collected)
    ]
    features = np.array([item[0] for item in moved])
    fit = {}
    for name, column in (("capture", 1), ("arrival", 2)):
        states = np.array([item[column] for item in moved])
        regressors = np.column_stack([states, states**2, np.ones(len(states))])
        residual = features - regressors @ np.linalg.lstsq(regressors, features)[0]
        fit[name] = np.sqrt(np.mean(residual**2))
    assert fit["capture"] < 0.3 * fit["arrival"], fit


def test_without_images_no_frame_arrives_and_the_tip_moves_the_same():
    blind = samples(0.5, images=False)
    assert not frames(blind)
    for one, other in zip(blind, samples(0.5), strict=True):
        np.testing.assert_array_equal(one.true_state, other.true_state)


@pytest.mark.parametrize("command", [[0, 0], [np.nan, 0, 0], [0, np.inf, 0], [[0, 0, 0]]])
def test_an_invalid_command_is_rejected(command):
    rig = Twin(load_config(), images=False)
    rig.reset()
    with pytest.raises(SignalError) as error:
        rig.step(command)
    assert error.value.field == "command"


def test_a_closed_twin_raises_and_may_be_closed_twice():
    rig = Twin(load_config(), images=False)
    with pytest.raises(SignalError):
        rig.step(POSTURE)
    rig.reset()
    rig.close()
    rig.close()
    with pytest.raises(SignalError):
        rig.step(POSTURE)


def test_bends_out_of_range_are_rejected_and_the_old_value_stays():
    rig = Twin(load_config(), images=False)
    rig.reset()
    rig.bends = 1.5
    with pytest.raises(ConfigError) as error:
        rig.bends = 7.0
    assert error.value.field == "twin.bends"
    assert rig.bends == 1.5
