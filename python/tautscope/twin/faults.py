"""A twin in which something fails, for a purpose: seeded, and never anything but a twin."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.loop.references import Reference, Segment
from tautscope.loop.rig import Frame, Sample
from tautscope.twin.fault_frames import FEATURES, FRAMES, IMAGES, Arrivals, FeatureFrame, Moment
from tautscope.twin.fault_kinds import KINDS, PER_MM, Fault, Kind, Mode, Target
from tautscope.twin.fault_motion import DRIVES, ENCODERS, HANDS, PHYSICS, RATE, Act
from tautscope.twin.plant import Plant
from tautscope.twin.rig import Twin

__all__ = [
    "KINDS",
    "PER_MM",
    "Fault",
    "FaultyHand",
    "FaultyRig",
    "FeatureFrame",
    "Kind",
    "Mode",
    "Target",
]

Floats = NDArray[np.float64]

_TOGETHER: tuple[tuple[Target, ...], ...] = (
    (Target.FEATURES, Target.FRAMES),
    (Target.PHYSICS,),
    (Target.DRIVE,),
    (Target.TICK,),
)
"""What is asked for at once; only these are."""
_PUSH = 1e-4
"""Over which the features' way along the channel is taken [m]."""


class FaultyRig:
    """A twin with faults in its camera, clock, drives and physics; implements `Rig`.

    What fails is what the loop sees and does. The truth, `Sample.true_state` and the true features
    and visible share of a `Frame`, stays the truth. Faults act in the order of the list. Without
    one that is active, samples are the twin's own, bit for bit.

    Faults of the hand do nothing here: `FaultyHand` has them.

    Args:
        twin: What fails; it may be under way already. Nothing else is ever made to fail.
        faults: What goes wrong, and when.
        seed: Of everything random about them; the same gives the same bytes.

    Raises:
        FieldError: The rig is no twin, or a picture cannot be spoilt as asked.
    """

    def __init__(self, twin: Twin, faults: Sequence[Fault], seed: int) -> None:
        if not isinstance(twin, Twin):
            raise FieldError("twin", twin, "a simulated Twin: faults are never made on hardware")
        for index, fault in enumerate(faults):
            if twin.draws and fault.row.target is Target.FEATURES and not fault.row.on_images:
                allowed = [kind.name for kind in KINDS.values() if kind.on_images]
                raise FieldError(
                    f"faults[{index}].kind", fault.kind, "on pictures: " + str(allowed)
                )
        self._twin = twin
        self._faults = tuple(faults)
        self._seed = seed
        self._held: Floats | None = None
        self._forget()

    @property
    def control_period(self) -> float:
        """[s]."""
        return self._twin.control_period

    @property
    def true_time(self) -> float:
        """The twin's own clock, whatever the samples say [s]."""
        return self._time

    @property
    def drive_fault(self) -> bool:
        """Whether a drive reports a fault now."""
        return any(fault.kind == "axis_off" and fault.active(self._time) for fault in self._faults)

    def reset(self) -> Sample:
        """As `Twin.reset`."""
        sample = self._twin.reset()
        self._forget()
        return self._seen(sample)

    def step(self, command: ArrayLike) -> Sample:
        """As `Twin.step`; a stall lets many control periods pass at once."""
        sample = self._once(command)
        for _ in range(self._missed_ticks()):
            frame = sample.frame
            sample = self._once(command)
            if sample.frame is None:
                sample = replace(sample, frame=frame)
        return sample

    def brake(self) -> None:
        """From now on the motors stay where they are, whatever they are told, and whatever their
        encoders say; a motor that runs against its brake is none of the faults.
        """  # noqa: D205
        self._held = self._twin.plant.applied

    def close(self) -> None:
        """As `Twin.close`."""
        self._twin.close()

    def _forget(self) -> None:
        self._held = None
        self._time = self._twin.time
        self._under_way: Arrivals = []
        camera, instrument = self._twin.config.camera, self._twin.config.instrument
        places = instrument.marker_a, instrument.marker_b
        self._eye = _Eye(self._twin.config, places)
        self._moments = [
            _moment(fault, self._seed, index, (camera.width, camera.height), self._along)
            for index, fault in enumerate(self._faults)
        ]
        self._together = {
            targets: [each for each in self._moments if each.fault.row.target in targets]
            for targets in _TOGETHER
        }

    def _along(self) -> Floats:
        return self._eye.along(self._twin.plant)

    def _active(self, *targets: Target) -> list[Moment]:
        found = []
        for moment in self._together[targets]:
            if moment.fault.active(self._time):
                moment.since = self._time - moment.fault.start
                found.append(moment)
        return found

    def _once(self, command: ArrayLike) -> Sample:
        told = self._held
        if told is None:
            told = _acted(DRIVES, np.asarray(command, dtype=np.float64), self._active(Target.DRIVE))
        self._disturb(self._twin.plant)
        return self._seen(self._twin.step(told))

    def _disturb(self, plant: Plant) -> None:
        for moment in self._active(Target.PHYSICS):
            moment.memory["acted"] = True
            PHYSICS[moment.fault.kind](plant, moment)
        for moment in self._together[(Target.PHYSICS,)]:
            # What a fault changed, it gives back once: later it may be another's.
            over = not moment.fault.active(self._time)
            if over and moment.memory.pop("acted", False):
                plant.bends = moment.memory.pop("bends", plant.bends)
                plant.tip_force, plant.section_friction = 0.0, 1.0

    def _seen(self, sample: Sample) -> Sample:
        self._time = sample.time
        if not self._faults:
            return sample
        applied = _acted(ENCODERS, sample.applied, self._active(Target.DRIVE))
        frame = self._arrived(sample)
        if frame is not None and (stamp := self._clock(frame.captured_at)) != frame.captured_at:
            frame = replace(frame, captured_at=stamp)
        return Sample(self._clock(sample.time), applied, frame, sample.true_state)

    def _arrived(self, sample: Sample) -> Frame | None:
        if sample.frame is not None:
            self._under_way += self._spoilt(sample.time, sample.frame)
            self._under_way.sort(key=lambda each: each[0])
        newest = None
        while self._under_way and self._under_way[0][0] <= sample.time:
            newest = self._under_way.pop(0)[1]
        return newest

    def _spoilt(self, due: float, frame: Frame) -> Arrivals:
        arrivals = [(due, frame)]
        for moment in self._active(Target.FEATURES, Target.FRAMES):
            timed = FRAMES.get(moment.fault.kind)
            if timed is None:
                arrivals = [(at, _looked(each, moment)) for at, each in arrivals]
            else:
                arrivals = [new for at, each in arrivals for new in timed(at, each, moment)]
        return arrivals

    def _clock(self, time: float) -> float:
        """What the rig's clock shows at a time."""
        shown = time
        for fault in self._faults:
            if time >= fault.start and fault.kind in {"clock_ahead", "clock_back"}:
                shown += fault.size if fault.kind == "clock_ahead" else -fault.size
            elif time >= fault.start and fault.kind == "clock_slow":
                shown -= (1 - fault.size) * min(time - fault.start, fault.duration)
        return shown

    def _missed_ticks(self) -> int:
        missed = 0.0
        for moment in self._active(Target.TICK):
            again = moment.fault.kind == "stalls" and moment.since * RATE >= moment.stalls
            if again or (moment.fault.kind == "stall" and moment.stalls == 0):
                moment.stalls += 1
                missed += moment.fault.size
        return round(missed / self.control_period)


class FaultyHand:
    """A reference that comes out of a device with faults; a `Reference`.

    To be called once per tick, with times that grow.

    Args:
        reference: What the hand does.
        faults: Those of the hand act, the others do not.
        seed: As `FaultyRig`.
    """

    def __init__(self, reference: Reference, faults: Sequence[Fault], seed: int) -> None:
        self._reference = reference
        self._moments = [
            _moment(fault, seed, index, (1, 1), lambda: np.zeros(4))
            for index, fault in enumerate(faults)
            if fault.row.target is Target.REFERENCE
        ]

    @property
    def duration(self) -> float:
        """[s]."""
        return self._reference.duration

    @property
    def segments(self) -> Sequence[Segment]:
        """Those of what the hand does."""
        return self._reference.segments

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        active = [moment for moment in self._moments if moment.fault.active(time)]
        for moment in active:
            moment.since = time - moment.fault.start
        return _acted(HANDS, self._reference(time), active)


class _Eye:
    """Where the bands are in the picture, by the physics and OpenCV: nothing of the loop."""

    def __init__(self, config: Config, places: tuple[float, float]) -> None:
        camera = config.camera
        self._matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
        self._distortion = np.array(camera.distortion)
        self._pose = camera.camera_from_guide
        self._places = np.array(places)[:, None]

    def along(self, plant: Plant) -> Floats:
        """(4,) [px/m] how the centres of the bands move when the instrument is pushed outwards."""
        points, directions = plant.centreline()
        bands = points[-2] + self._places * directions[-2]
        ends = np.vstack([bands, bands + np.array([0.0, 0.0, _PUSH])])
        rotation, translation = np.array(self._pose.rotation), np.array(self._pose.translation)
        seen, _ = cv2.projectPoints(ends, rotation, translation, self._matrix, self._distortion)
        return np.asarray(np.diff(seen.reshape(2, 4), axis=0)[0] / _PUSH, dtype=np.float64)


def _moment(
    fault: Fault, seed: int, index: int, size: tuple[int, int], along: Callable[[], Floats]
) -> Moment:
    chance = np.random.default_rng([seed, index, zlib.crc32(fault.kind.encode())])
    return Moment(fault, 0.0, chance, {}, size, along)


def _acted(acts: dict[str, Act], values: Floats, active: Sequence[Moment]) -> Floats:
    for moment in active:
        act = acts.get(moment.fault.kind)
        if act is not None:
            values = act(values, moment)
    return values


def _looked(frame: Frame, moment: Moment) -> Frame:
    kind = moment.fault.kind
    if isinstance(frame, FeatureFrame):
        return replace(frame, features=FEATURES[kind](frame.features, moment))
    return replace(frame, image=IMAGES[kind](frame.image, moment))
