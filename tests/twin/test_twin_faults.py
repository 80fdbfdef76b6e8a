"""Faults in the twin act when they say, on nothing else, and never on hardware; seeds reproduce."""

from __future__ import annotations

import math

import numpy as np
import pytest
from failing import (
    BARE,
    CONFIG,
    DURATION,
    ONLY,
    PERIOD,
    START,
    SeenTwin,
    digest,
    fault,
    frames,
    run,
)
from tautscope import Rig, Sample, Twin
from tautscope.errors import FieldError
from tautscope.twin.fault_frames import FEATURES, FRAMES, IMAGES
from tautscope.twin.fault_motion import DRIVES, ENCODERS, HANDS, PHYSICS
from tautscope.twin.faults import KINDS, Fault, FaultyRig, Mode, Target

RANDOM = {
    *("outliers", "outliers_some", "noisy", "random", "band_elsewhere", "frozen_noisy"),
    *("not_finite", "jitter", "stamp_jitter", "dropped"),
}
"""Kinds that another seed makes different."""


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
