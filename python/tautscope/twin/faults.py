"""Fault injection into the simulated rig and into the operator's reference, seeded."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike

from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.loop.references import Reference
from tautscope.loop.rig import Frame, Sample
from tautscope.twin import fault_motion as motion
from tautscope.twin.fault_frames import (
    ARRIVAL_FAULTS,
    FEATURE_FAULTS,
    IMAGE_FAULTS,
    Arrivals,
    FeatureFrame,
)
from tautscope.twin.fault_kinds import KINDS, PER_MM, Fault, Kind, Mode, Target
from tautscope.twin.fault_state import FaultState, Floats
from tautscope.twin.plant import Plant
from tautscope.twin.rig import Twin

_STEP = 1e-4
"""Insertion over which the motion of the features is measured [m]."""


class FaultyRig:
    """A simulated rig with faults in its camera, clock, drives and plant; implements `Rig`.

    Faults change what the loop measures and commands, in the order of the list. The ground truth
    (`Sample.true_state`, true features and visible share of a `Frame`) is not changed. Without an
    active fault the samples are those of the twin, bit for bit.

    Faults of the operator input have no effect here; see `FaultyReference`.

    Args:
        twin: The simulated rig; it may already be running.
        faults: Kind, time and severity of each fault.
        seed: Random seed; the same seed gives the same bytes.

    Attributes:
        true_time: Time of the twin's clock [s], which clock faults do not change.

    Raises:
        FieldError: The rig is not a `Twin`, or a fault cannot be applied to images.
    """

    def __init__(self, twin: Twin, faults: Sequence[Fault], seed: int) -> None:
        if not isinstance(twin, Twin):
            raise FieldError("twin", twin, "a simulated Twin: faults are never made on hardware")
        for index, fault in enumerate(faults):
            has_model = fault.row.on_images or fault.row.target is not Target.FEATURES
            if twin.has_images and not has_model:
                allowed = [kind.name for kind in KINDS.values() if kind.on_images]
                raise FieldError(
                    f"faults[{index}].kind", fault.kind, f"one that applies to images: {allowed}"
                )
        self._twin, self.control_period = twin, twin.control_period
        self._faults = tuple(faults)
        self._seed = seed
        self._brake_position: Floats | None = None
        self._reset_faults()

    @property
    def drive_fault(self) -> bool:
        """Whether a drive reports a fault now."""
        return any(
            fault.kind == "axis_off" and fault.is_active(self.true_time) for fault in self._faults
        )

    def reset(self) -> Sample:
        """As `Twin.reset`; every fault starts anew."""
        sample = self._twin.reset()
        self._reset_faults()
        return self._with_sensor_faults(sample)

    def step(self, command: ArrayLike) -> Sample:
        """As `Twin.step`; during a stall several control periods pass in one call."""
        sample = self._step_once(command)
        for _ in range(self._missed_ticks()):
            frame = sample.frame
            sample = self._step_once(command)
            if sample.frame is None:
                sample = replace(sample, frame=frame)
        return sample

    def brake(self) -> None:
        """Hold the motors where they are, whatever they are commanded and the encoders read."""
        self._brake_position = self._twin.plant.applied

    def close(self) -> None:
        """As `Twin.close`."""
        self._twin.close()

    def _reset_faults(self) -> None:
        self._brake_position = None
        self.true_time = self._twin.time
        self._in_transit: Arrivals = []
        camera = self._twin.config.camera
        self._states = [
            FaultState.seeded(
                fault,
                self._seed,
                index,
                image_size=(camera.width, camera.height),
                channel_jacobian=lambda: _channel_jacobian(self._twin.config, self._twin.plant),
            )
            for index, fault in enumerate(self._faults)
        ]

    def _active(self, *targets: Target) -> list[FaultState]:
        return [
            fault
            for fault in self._states
            if fault.spec.row.target in targets and fault.update(self.true_time)
        ]

    def _step_once(self, command: ArrayLike) -> Sample:
        target = self._brake_position
        if target is None:
            values = np.asarray(command, dtype=np.float64)
            target = motion.apply_to_axes(motion.DRIVE_FAULTS, values, self._active(Target.DRIVE))
        self._change_plant(self._twin.plant)
        return self._with_sensor_faults(self._twin.step(target))

    def _change_plant(self, plant: Plant) -> None:
        for fault in self._active(Target.PHYSICS):
            fault.memory["acted"] = True
            for name, value in motion.PLANT_FAULTS[fault.spec.kind](plant, fault).items():
                setattr(plant, name, value)
        for fault in self._states:
            # A fault that ended restores the plant once: later its values may be another fault's.
            if not fault.spec.is_active(self.true_time) and fault.memory.pop("acted", False):
                plant.bends = fault.memory.pop("bends", plant.bends)
                plant.tip_force, plant.section_friction = 0.0, 1.0

    def _with_sensor_faults(self, sample: Sample) -> Sample:
        self.true_time = sample.time
        if not self._faults:
            return sample
        drives = self._active(Target.DRIVE)
        applied = motion.apply_to_axes(motion.ENCODER_FAULTS, sample.applied, drives)
        frame = self._newest_frame(sample)
        if frame is not None and (stamp := self._clock(frame.captured_at)) != frame.captured_at:
            frame = replace(frame, captured_at=stamp)
        return Sample(self._clock(sample.time), applied, frame, sample.true_state)

    def _newest_frame(self, sample: Sample) -> Frame | None:
        if sample.frame is not None:
            self._in_transit += self._with_camera_faults(sample.time, sample.frame)
            self._in_transit.sort(key=lambda arrival: arrival[0])
        newest = None
        while self._in_transit and self._in_transit[0][0] <= sample.time:
            newest = self._in_transit.pop(0)[1]
        return newest

    def _with_camera_faults(self, time: float, frame: Frame) -> Arrivals:
        arrivals = [(time, frame)]
        for fault in self._active(Target.FEATURES, Target.FRAMES):
            model = ARRIVAL_FAULTS.get(fault.spec.kind)
            if model is None:
                arrivals = [(due, _with_content_fault(each, fault)) for due, each in arrivals]
            else:
                arrivals = [new for due, each in arrivals for new in model(due, each, fault)]
        return arrivals

    def _clock(self, time: float) -> float:
        """Reading of the rig's faulty clock at a true time [s]."""
        reading = time
        for fault in self._faults:
            if time >= fault.start and fault.kind in {"clock_ahead", "clock_back"}:
                reading += fault.size if fault.kind == "clock_ahead" else -fault.size
            elif time >= fault.start and fault.kind == "clock_slow":
                reading -= (1 - fault.size) * min(time - fault.start, fault.duration)
        return reading

    def _missed_ticks(self) -> int:
        missed = 0.0
        for fault in self._active(Target.TICK):
            kind, stalls = fault.spec.kind, fault.memory.get("stalls", 0)
            is_due = kind == "stalls" and fault.elapsed * motion.EVENT_RATE >= stalls
            if is_due or (kind == "stall" and stalls == 0):
                fault.memory["stalls"] = stalls + 1
                missed += fault.size
        return round(missed / self.control_period)


class FaultyReference:
    """The operator's reference through an input device with faults; a `Reference`.

    Call it once per tick, with rising times. Faults of anything else have no effect.
    """

    def __init__(self, reference: Reference, faults: Sequence[Fault], seed: int) -> None:
        self._reference = reference
        self.duration, self.segments = reference.duration, reference.segments
        self._states = [
            FaultState.seeded(fault, seed, index)
            for index, fault in enumerate(faults)
            if fault.row.target is Target.REFERENCE
        ]

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        active = [fault for fault in self._states if fault.update(time)]
        return motion.apply_to_axes(motion.REFERENCE_FAULTS, self._reference(time), active)


def _with_content_fault(frame: Frame, fault: FaultState) -> Frame:
    kind = fault.spec.kind
    if isinstance(frame, FeatureFrame):
        return replace(frame, features=FEATURE_FAULTS[kind](frame.features, fault))
    return replace(frame, image=IMAGE_FAULTS[kind](frame.image, fault))


def _channel_jacobian(config: Config, plant: Plant) -> Floats:
    """(4,) [px/m] motion of the band centres in the image per insertion of the instrument."""
    camera, instrument = config.camera, config.instrument
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    pose = camera.camera_from_guide
    points, directions = plant.centreline()
    markers = np.array((instrument.marker_a, instrument.marker_b))[:, None]
    bands = points[-2] + markers * directions[-2]
    ends = np.vstack([bands, bands + np.array([0.0, 0.0, _STEP])])
    pose_vectors = np.array(pose.rotation), np.array(pose.translation)
    pixels, _ = cv2.projectPoints(ends, *pose_vectors, matrix, np.array(camera.distortion))
    return np.asarray(np.diff(pixels.reshape(2, 4), axis=0)[0] / _STEP, dtype=np.float64)
