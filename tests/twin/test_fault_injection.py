"""Faults act at their time, on their target and on simulated rigs only; seeds reproduce them."""

import math

import numpy as np
import pytest
from faulty_runs import (
    CONFIG,
    DURATION,
    KINDS_BY_TARGET,
    NOMINAL,
    PERIOD,
    START,
    FeatureTwin,
    digest,
    fault,
    frames,
    run,
)
from tautscope import Rig, Sample, Twin
from tautscope.errors import FieldError
from tautscope.twin.fault_frames import ARRIVAL_FAULTS, FEATURE_FAULTS, IMAGE_FAULTS
from tautscope.twin.fault_motion import DRIVE_FAULTS, ENCODER_FAULTS, PLANT_FAULTS, REFERENCE_FAULTS
from tautscope.twin.faults import KINDS, Fault, FaultyRig, Mode, Target

SEEDED_KINDS = {
    *("outliers", "outliers_some", "noisy", "random", "band_elsewhere", "frozen_noisy"),
    *("not_finite", "jitter", "stamp_jitter", "dropped"),
}
"""Kinds whose effect depends on the seed."""


def test_the_kinds_cover_all_targets_and_modes():
    assert len(KINDS) >= 40
    assert {row.mode for row in KINDS.values()} == set(Mode)
    assert {row.target for row in KINDS.values()} == set(Target)
    for target in (Target.FEATURES, Target.FRAMES, Target.DRIVE):
        modes = {KINDS[name].mode for name in KINDS_BY_TARGET[target]}
        assert modes >= {Mode.OFF, Mode.STUCK, Mode.GARBAGE, Mode.WRONG, Mode.SLOW}, target
        assert Mode.INTERMITTENT in modes, target


def test_every_kind_has_a_model():
    assert set(KINDS_BY_TARGET[Target.FEATURES]) == set(FEATURE_FAULTS) >= set(IMAGE_FAULTS)
    assert set(KINDS_BY_TARGET[Target.FRAMES]) == set(ARRIVAL_FAULTS)
    assert set(KINDS_BY_TARGET[Target.DRIVE]) == set(DRIVE_FAULTS) | set(ENCODER_FAULTS)
    assert set(KINDS_BY_TARGET[Target.REFERENCE]) == set(REFERENCE_FAULTS)
    assert set(KINDS_BY_TARGET[Target.PHYSICS]) == set(PLANT_FAULTS)
    assert {row.name for row in KINDS.values() if row.on_images} == set(IMAGE_FAULTS) | {"ok"}


class Hardware:
    """A rig with all members of `Twin` that is not a `Twin`."""

    control_period = PERIOD
    config = CONFIG
    time = 0.0
    has_images = False

    def reset(self) -> Sample:
        return Sample(0.0, np.zeros(3))

    def step(self, command) -> Sample:
        return Sample(PERIOD, np.zeros(3))

    def close(self) -> None:
        pass


@pytest.mark.parametrize("rig", [Hardware(), None, FaultyRig(FeatureTwin(), (), 0), Twin])
def test_faults_are_injected_into_a_twin_only(rig):
    with pytest.raises(FieldError, match="never made on hardware") as error:
        FaultyRig(rig, (), 0)
    assert error.value.field == "twin"


def test_it_is_a_rig():
    assert isinstance(FaultyRig(FeatureTwin(), (), 0), Rig)


@pytest.mark.parametrize("name", KINDS)
def test_before_it_begins_a_fault_changes_no_bit(name):
    assert digest(run(Fault(name, start=1e6), seconds=0.3)) == digest(
        NOMINAL[: round(0.3 / PERIOD) + 1]
    )


def test_ok_changes_no_bit():
    assert digest(run(fault("ok"))) == digest(NOMINAL)


def test_ok_changes_no_bit_of_an_image():
    runs = []
    for wrapped in (False, True):
        twin = Twin(CONFIG)
        rig = FaultyRig(twin, (fault("ok", start=0.0),), 1) if wrapped else twin
        runs.append(digest(run(rig=rig, twin=twin, seconds=0.25)))
    assert runs[0] == runs[1]


@pytest.mark.parametrize("name", sorted(KINDS))
def test_the_same_seed_gives_the_same_bytes(name):
    size = sum(KINDS[name].severity) / 2
    faulty = fault(name, severity=size)
    first, again, other = (digest(run(faulty, seconds=0.7, seed=s)) for s in (7, 7, 8))
    assert first == again, "seed 7"
    if name in SEEDED_KINDS:
        assert first != other, "seeds 7, 8"


@pytest.mark.parametrize("name", KINDS_BY_TARGET[Target.FEATURES] + KINDS_BY_TARGET[Target.FRAMES])
def test_camera_faults_do_not_change_truth_or_motors(name):
    collected = run(fault(name))
    for actual, expected in zip(collected, NOMINAL, strict=True):
        assert actual.time == expected.time
        np.testing.assert_array_equal(actual.true_state, expected.true_state)
        np.testing.assert_array_equal(actual.applied, expected.applied)
    truth = {frame.sequence: frame for _, frame in frames(NOMINAL)}
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
def test_invalid_faults_are_rejected(field, wrong):
    with pytest.raises(FieldError) as error:
        Fault(**({"kind": "biased"} | wrong))
    assert error.value.field == field


def test_several_faults_act_together():
    collected = frames(run(fault("swapped"), fault("late", severity=0.1)))
    during = [(t, f) for t, f in collected if START + 0.1 <= t < START + DURATION]
    assert during
    for time, frame in during:
        np.testing.assert_array_equal(frame.features, frame.true_features[[2, 3, 0, 1]])
        assert time - frame.captured_at == pytest.approx(0.1, abs=1.01 * PERIOD)
