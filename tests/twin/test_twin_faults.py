"""Faults in the twin: each acts as it says, when it says, and on nothing else; seeds reproduce."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tautscope import Rig, Sample, Twin, load_config
from tautscope.blocks import build_feature_model
from tautscope.dof import Dof
from tautscope.errors import FieldError
from tautscope.twin.fault_frames import FEATURES, FRAMES, IMAGES
from tautscope.twin.fault_motion import DRIVES, ENCODERS, HANDS, PHYSICS
from tautscope.twin.faults import KINDS, Fault, FaultyHand, FaultyRig, FeatureFrame, Mode, Target

CONFIG = load_config()
PERIOD = CONFIG.control.period
EVERY = 8
START, DURATION = 0.4, 0.4
SEED = 5
CENTRE = np.array([0.025, 0.0, 0.9])
RANDOM = {
    *("outliers", "outliers_some", "noisy", "random", "band_elsewhere", "frozen_noisy"),
    *("not_finite", "jitter", "stamp_jitter", "dropped"),
}
IN_ENDING = {"late", "late_unknown", "jitter", "duplicate", "reordered"}
"""What they hold up comes after their end."""


class SeenTwin(Twin):
    """A twin whose detector says a straight line over time."""

    def __init__(self) -> None:
        super().__init__(CONFIG, images=False)
        self._shown = 0

    def reset(self) -> Sample:
        self._shown = 0
        return self._look(super().reset())

    def step(self, command) -> Sample:
        return self._look(super().step(command))

    def _look(self, sample: Sample) -> Sample:
        self._shown += 1
        if (self._shown - 1) % EVERY:
            return sample
        nothing = np.empty((0, 0, 3), np.uint8)
        truth = line(sample.time)
        frame = FeatureFrame(nothing, sample.time, self._shown, truth, features=truth.copy())
        return replace(sample, frame=frame)


def line(time):
    return np.array([100, 200, 150, 260]) + np.array([40, 10, 35, 5]) * time


def command(time):
    return CENTRE + np.array([0.012, 0.5, 0.3]) * time


def run(*faults, seconds=1.2, seed=SEED, rig=None, twin=None):
    twin = twin or SeenTwin()
    rig = rig or FaultyRig(twin, faults, seed)
    collected = [rig.reset()]
    while twin.time < seconds - 1e-9:
        collected.append(rig.step(command(twin.time)))
    return collected


def frames(collected):
    return [(sample.time, sample.frame) for sample in collected if sample.frame is not None]


def fault(kind, **changes):
    settings = {"start": START, "duration": DURATION} | changes
    return Fault(kind, **settings)


def digest(collected):
    sha = hashlib.sha256()
    for sample in collected:
        sha.update(np.array(sample.time).tobytes() + sample.applied.tobytes())
        sha.update(sample.true_state.tobytes())
        if (frame := sample.frame) is not None:
            sha.update(np.array([frame.captured_at, frame.sequence]).tobytes())
            sha.update(frame.image.tobytes() + frame.true_features.tobytes())
            if isinstance(frame, FeatureFrame):
                sha.update(frame.features.tobytes())
    return sha.hexdigest()


BARE = run(rig=(twin := SeenTwin()), twin=twin)
ONLY = {kind: [row.name for row in KINDS.values() if row.target is kind] for kind in Target}


def test_the_vocabulary_is_whole():
    assert len(KINDS) >= 40
    assert {row.mode for row in KINDS.values()} == set(Mode)
    assert {row.target for row in KINDS.values()} == set(Target)
    for target in (Target.FEATURES, Target.FRAMES, Target.DRIVE):
        modes = {KINDS[name].mode for name in ONLY[target]}
        assert modes >= {Mode.OFF, Mode.STUCK, Mode.GARBAGE, Mode.WRONG, Mode.SLOW}, target
        assert Mode.INTERMITTENT in modes, target


def test_every_kind_is_made_somewhere():
    assert set(ONLY[Target.FEATURES]) == set(FEATURES) >= set(IMAGES)
    assert set(ONLY[Target.FRAMES]) == set(FRAMES)
    assert set(ONLY[Target.DRIVE]) == set(DRIVES) | set(ENCODERS)
    assert set(ONLY[Target.REFERENCE]) == set(HANDS)
    assert set(ONLY[Target.PHYSICS]) == set(PHYSICS)
    assert {row.name for row in KINDS.values() if row.on_images} == set(IMAGES) | {"ok"}


class Hardware:
    """A rig with all members, and not a twin."""

    control_period = PERIOD
    config = CONFIG
    time = 0.0
    draws = False

    def reset(self) -> Sample:
        return Sample(0.0, np.zeros(3))

    def step(self, command) -> Sample:
        return Sample(PERIOD, np.zeros(3))

    def close(self) -> None:
        pass


@pytest.mark.parametrize("rig", [Hardware(), None, FaultyRig(SeenTwin(), (), 0), Twin])
def test_nothing_but_a_twin_is_made_to_fail(rig):
    with pytest.raises(FieldError, match="never made on hardware") as error:
        FaultyRig(rig, (), 0)
    assert error.value.field == "twin"


def test_it_is_a_rig():
    assert isinstance(FaultyRig(SeenTwin(), (), 0), Rig)


@pytest.mark.parametrize("name", KINDS)
def test_before_it_begins_a_fault_changes_no_bit(name):
    assert digest(run(Fault(name, start=1e6), seconds=0.3)) == digest(
        BARE[: round(0.3 / PERIOD) + 1]
    )


def test_ok_changes_no_bit():
    assert digest(run(fault("ok"))) == digest(BARE)


def test_ok_changes_no_bit_of_a_picture():
    runs = []
    for wrapped in (False, True):
        twin = Twin(CONFIG)
        rig = FaultyRig(twin, (fault("ok", start=0.0),), 1) if wrapped else twin
        runs.append(digest(run(rig=rig, twin=twin, seconds=0.25)))
    assert runs[0] == runs[1]


@pytest.mark.parametrize("name", sorted(KINDS))
def test_the_same_seed_gives_the_same_bytes(name):
    size = sum(KINDS[name].severity) / 2
    spoilt = fault(name, severity=size)
    first, again, other = (digest(run(spoilt, seconds=0.7, seed=s)) for s in (7, 7, 8))
    assert first == again, "seed 7"
    if name in RANDOM:
        assert first != other, "seeds 7, 8"


@pytest.mark.parametrize("name", ONLY[Target.FEATURES] + ONLY[Target.FRAMES])
def test_faults_of_the_camera_leave_truth_and_motors_alone(name):
    collected = run(fault(name))
    for got, expected in zip(collected, BARE, strict=True):
        assert got.time == expected.time
        np.testing.assert_array_equal(got.true_state, expected.true_state)
        np.testing.assert_array_equal(got.applied, expected.applied)
    truth = {frame.sequence: frame for _, frame in frames(BARE)}
    for _, frame in frames(collected):
        np.testing.assert_array_equal(frame.true_features, truth[frame.sequence].true_features)


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


def motors(name, dof=Dof.INSERTION, **changes):
    """Time since the start, where the motor is told by physics, what is read, and without fault."""
    twin = SeenTwin()
    rig = FaultyRig(twin, (fault(name, dof=dof, **changes),), SEED)
    rig.reset()
    table = []
    while twin.time < START + DURATION - PERIOD:
        sample = rig.step(command(twin.time))
        k = len(table) + 1
        table.append(
            (
                sample.time - START,
                twin.plant.applied[dof],
                sample.applied[dof],
                BARE[k].applied[dof],
            )
        )
    return np.array(table).T


LAG = 4 * 0.012 * PERIOD


def test_axis_off_and_stuck_stay_and_only_off_says_so():
    for name, says in (("axis_off", True), ("axis_stuck", False)):
        since, real, read, _ = motors(name)
        np.testing.assert_array_equal(real, read)
        assert np.ptp(real[since > 0.02]) < LAG
        rig = FaultyRig(SeenTwin(), (fault(name, start=0.0),), SEED)
        rig.reset()
        assert rig.drive_fault is says


@pytest.mark.parametrize("dof", list(Dof))
def test_only_the_named_axis_fails(dof):
    collected = run(fault("axis_stuck", dof=dof), seconds=START + DURATION)
    counts = np.abs(collected[-1].applied - BARE[round((START + DURATION) / PERIOD)].applied)
    counts /= CONFIG.twin.drives.encoder_step
    for other in Dof:
        # Motors feel each other a little, through the shaft.
        assert bool(counts[other] > 100) is (other is dof), counts


def test_axis_some_catches_up_and_axis_late_follows():
    since, real, _, free = motors("axis_some", severity=0.1)
    behind = free - real
    assert behind[(since > 0.05) & (since < 0.1)].min() > 4e-4
    assert np.abs(behind[(since > 0.15) & (since < 0.2)]).max() < LAG
    since, real, _, free = motors("axis_late", severity=0.1)
    late = np.interp(since - 0.1, since, free)
    assert np.abs(real - late)[since > 0.15].max() < LAG


def test_axis_slow_limited_reversed_scaled_runs():
    since, real, _, free = motors("axis_slow", severity=2.0)
    speed = np.polyfit(since[since > 0.05], real[since > 0.05], 1)[0]
    assert speed == pytest.approx(2e-3, rel=0.05)
    at = np.interp(0, since, free)
    since, real, _, _ = motors("axis_limited", severity=1.0)
    assert real[-1] == pytest.approx(at + 1e-3, abs=LAG)
    since, real, _, free = motors("axis_reversed")
    np.testing.assert_allclose((real + free)[since > 0.05], 2 * at, atol=2 * LAG)
    since, real, read, free = motors("axis_scaled", severity=2.0)
    np.testing.assert_allclose((real - at)[since > 0.05], 2 * (free - at)[since > 0.05], atol=3e-4)
    np.testing.assert_allclose(read[since > 0.05], free[since > 0.05], atol=3e-4)
    since, real, _, _ = motors("axis_runs", severity=20.0)
    assert abs(real[-1] - at) == pytest.approx(20e-3 * since[-1], rel=0.1)
    _, real, _, free = motors("axis_shaking", severity=1.0)
    assert 2e-4 < np.std(real - free) < 1e-3


def test_encoders_that_lie():
    since, real, read, free = motors("encoder_jump", severity=5.0, duration=math.inf)
    settled = since > 0.1
    assert np.abs(np.abs(real - free)[settled] - 5e-3).max() < LAG
    np.testing.assert_allclose(read[settled], free[settled], atol=LAG)
    since, real, read, free = motors("encoder_stuck")
    np.testing.assert_array_equal(real, free)
    assert np.ptp(read[since >= 0]) == 0
    _, real, read, free = motors("encoder_noisy", severity=5.0)
    np.testing.assert_array_equal(real, free)
    assert 1e-3 < np.abs(read - real).max() <= 5e-3


@pytest.mark.parametrize("name", ["ok", "axis_reversed", "axis_runs", "encoder_stuck"])
def test_with_the_brakes_on_motors_stay_where_they_are(name):
    twin = SeenTwin()
    rig = FaultyRig(twin, (fault(name, start=0.0),), SEED)
    rig.reset()
    for tick in range(40):
        rig.step(command(tick * PERIOD))
    at = twin.plant.applied
    assert (at - CENTRE)[0] > 1e-3 or name != "ok"
    rig.brake()
    for tick in range(40, 120):
        rig.step(command(tick * PERIOD))
    assert (np.abs(twin.plant.applied - at) < np.array([LAG, 0.1, 0.05])).all()


def test_a_stall_lets_time_pass_at_once_and_physics_go_on():
    times = np.array([s.time for s in run(fault("stall", severity=0.3, duration=math.inf))])
    gaps = np.diff(times)
    assert (gaps > 1.5 * PERIOD).sum() == 1
    assert gaps.max() == pytest.approx(0.3 + PERIOD)
    gaps = np.diff([s.time for s in run(fault("stalls", severity=0.05))])
    assert (gaps > 1.5 * PERIOD).sum() == 2


def test_the_clock_jumps_and_runs_slow_while_true_time_does_not():
    jumps = {"clock_ahead": 10.0, "clock_back": -10.0}
    for name, jump in jumps.items():
        collected = run(fault(name, severity=10.0, duration=math.inf))
        for got, expected in zip(collected, BARE, strict=True):
            late = expected.time >= START
            assert got.time == pytest.approx(expected.time + jump * late)
            if got.frame is not None:
                assert got.frame.captured_at == pytest.approx(got.time)
    collected = run(fault("clock_slow", severity=0.5))
    assert collected[-1].time == pytest.approx(BARE[-1].time - 0.5 * DURATION)


def test_physics_acts_on_the_plant_and_is_given_back():
    def plant(name, seconds, **changes):
        twin = SeenTwin()
        run(fault(name, **changes), seconds=seconds, twin=twin)
        return twin

    during, after = START + 0.3, START + DURATION + 0.1
    assert plant("straightens", during, severity=1.0).bends == pytest.approx(4 - 3 * 0.3, abs=0.05)
    assert plant("straightens_suddenly", during, severity=1.0).bends == 1.0
    assert plant("winds", during, severity=6.0).bends == pytest.approx(4 + 2 * 0.06, abs=0.01)
    assert plant("straightens", after).bends == CONFIG.twin.bends
    assert plant("section_stiff", during, severity=2.0).plant.section_friction == 2.0
    assert plant("section_stiff", after, severity=2.0).plant.section_friction == 1.0
    pushed = plant("tissue_pushes", during, severity=4.0)
    assert pushed.plant.tip_force == 4.0
    free = BARE[round(during / PERIOD)].true_state[0]
    assert pushed.plant.true_state[0] > free + 1e-3, "pushed outwards"
    assert plant("tissue_pushes", after).plant.tip_force == 0.0
    assert plant("tissue_jerks", START + 0.1, severity=3.0).plant.tip_force == 3.0
    assert plant("tissue_jerks", START + 0.3, severity=3.0).plant.tip_force == 0.0


class Line:
    """A hand at 10 mm/s."""

    duration = 2.0
    segments = ()

    def __call__(self, time):
        return CENTRE + 0.01 * time * np.eye(3)[0]


def hand(name, **changes):
    """Times since the start, and how far the device is off the hand [m]; outside it is not."""
    faulty = FaultyHand(Line(), (fault(name, **changes),), SEED)
    times = np.arange(0, 1.2, PERIOD)
    off = np.array([faulty(t)[0] - Line()(t)[0] for t in times])
    inside = (times >= START) & (times < START + DURATION)
    if math.isfinite(faulty._moments[0].fault.duration):
        assert np.all(off[~inside] == 0)
    return times[inside] - START, off[inside]


def test_the_hand():
    _, off = hand("hand_step", severity=5.0)
    assert np.ptp(off) < 1e-9
    assert abs(off[0]) == pytest.approx(5e-3)
    _, off = hand("hand_displaced", severity=5.0, duration=math.inf)
    assert abs(off[0]) == pytest.approx(5e-3)
    _, off = hand("hand_spikes", severity=5.0)
    assert (np.abs(off) > 1e-9).sum() == 2
    since, off = hand("hand_fast", severity=100.0)
    np.testing.assert_allclose(np.abs(off), 0.1 * since, atol=1e-12)
    since, off = hand("hand_silent")
    np.testing.assert_allclose(off, -0.01 * since, atol=1e-12)
    since, off = hand("hand_late", severity=0.1)
    np.testing.assert_allclose(off, -0.01 * np.minimum(since, 0.1), atol=1e-4)
    since, off = hand("hand_slow", severity=5.0)
    assert len(np.unique(np.round(off + 0.01 * since, 9))) == 2
    _, off = hand("hand_nan")
    assert not np.isfinite(off).any()
    _, off = hand("hand_noisy", severity=1.0)
    assert 3e-4 < np.std(off) < 1e-3
    _, off = hand("hand_tremor", severity=1.0)
    assert 0.9e-3 < np.abs(off).max() <= 1e-3
    turns = (np.diff(np.sign(off)) != 0).sum()
    assert 2 * 6 * DURATION - 2 <= turns <= 2 * 12 * DURATION + 1


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


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("fault.kind", {"kind": "sneezing"}),
        ("fault.start", {"start": math.nan}),
        ("fault.duration", {"duration": 0.0}),
        ("fault.duration", {"duration": math.nan}),
        ("fault.severity", {"severity": 100.0}),
        ("fault.severity", {"severity": math.nan}),
    ],
)
def test_what_is_no_fault_is_named(field, wrong):
    with pytest.raises(FieldError) as error:
        Fault(**({"kind": "biased"} | wrong))
    assert error.value.field == field


def test_several_faults_act_together():
    collected = frames(run(fault("swapped"), fault("late", severity=0.1)))
    inside = [(t, f) for t, f in collected if START + 0.1 <= t < START + DURATION]
    assert inside
    for time, frame in inside:
        np.testing.assert_array_equal(frame.features, frame.true_features[[2, 3, 0, 1]])
        assert time - frame.captured_at == pytest.approx(0.1, abs=1.01 * PERIOD)
