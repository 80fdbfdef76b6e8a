"""Delay between motors and images of a record: a log, or a video with motor positions."""

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from tautscope.calibration.delay import LIMIT, DelayEstimate, estimate_delay
from tautscope.calibration.tip_states import tip_states
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.loop.rig import Frame
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import MarkerDetector, workspace_starts
from tautscope.runs.recording import Floats, Recording, per_dof, per_feature

PLAUSIBLE_GAINS = 0.3, 3.0
"""Travel of the tip over that of its motor in contact."""
_UNITS = {Dof.INSERTION: {"mm": 1e-3, "cm": 1e-2}, Dof.ROTATION: {"deg": math.pi / 180}}
_UNITS[Dof.BENDING] = _UNITS[Dof.ROTATION]


def align_video(
    frames: Iterable[Frame],
    times: Floats,
    positions: Floats,
    config: Config,
    *,
    limit: float = LIMIT,
    progress: Callable[[float], None] | None = None,
) -> tuple[DelayEstimate, Floats]:
    """Estimate the delay of a video behind motor positions.

    The bands are searched in each image by itself, in the workspace of the experiment.

    Args:
        frames: Frames in order, stamped on about the clock of the motors.
        times: (n,) of the motor positions [s], increasing.
        positions: (n, 3) motor positions [m, rad, rad].
        config: Instrument, camera, and workspace of the experiment.
        limit: Largest magnitude of a delay [s].
        progress: Called with the share of the motors' time that is done.

    Returns:
        The estimate, and the stamps of the frames (m,) [s].

    Raises:
        RecordError: There are fewer than two frames or motor positions.
        FrameError: The video is not from the configured camera.
    """
    if len(times) < 2:
        raise RecordError("motor positions", f"{len(times)} line", "at least 2")
    detector = MarkerDetector(config)
    starts, spread = workspace_starts(config)
    anywhere = StatePrediction(starts[0], spread)
    stamps: list[float] = []
    features: list[Floats] = []
    first, span = 0.0, float(times[-1] - times[0])
    for frame in frames:
        first = first if stamps else frame.captured_at
        stamps.append(frame.captured_at)
        detection = detector.detect(frame.image, expectation=anywhere)
        if not detection.valid:
            detection = detector.detect(frame.image)  # slower, from more postures
        features.append(detection.features)
        if progress is not None:
            progress(min((frame.captured_at - first) / span, 1.0))
    if len(stamps) < 2:
        raise RecordError("video", f"{len(stamps)} frames", "at least 2")
    clock = np.array(stamps)
    tips = tip_states(np.array(features), config)
    return estimate_delay(times, positions, clock, tips, limit), clock


def align_recording(recording: Recording, limit: float = LIMIT) -> DelayEstimate:
    """Estimate the delay of the images of a run behind its commands.

    The commands, because the loop compares the images with these; a lag of the drives is part of
    the delay. The bands are those that were found in the run.

    Raises:
        RecordError: The run has fewer than two ticks or images, each later than the one before, or
            another sensor.
    """
    if recording.config.dof:
        allowed = "images; of another sensor `tautscope calibrate latency --rig` finds the delay"
        raise RecordError("log", "no images", allowed)
    trace, frames = recording.trace, recording.frames
    frames = frames[np.diff(frames["captured_at"], prepend=-np.inf) > 0]
    if min(len(trace), len(frames)) < 2:
        found = f"{len(trace)} ticks and {len(frames)} images"
        raise RecordError("recording", found, "at least 2 of each")
    tips = tip_states(per_feature(frames, "features"), recording.config)
    commands = per_dof(trace, "command")
    return estimate_delay(trace["time"], commands, frames["captured_at"], tips, limit)


def implausible_motors(estimate: DelayEstimate) -> Iterator[str]:
    """A sentence per motor whose unit or sign does not fit the images."""
    probe = estimate.model
    if probe is None:
        return
    least, largest = PLAUSIBLE_GAINS
    for dof, gain in zip(Dof, probe.gains, strict=True):
        if math.isnan(gain) or least < gain < largest:
            continue
        if least < -gain < largest:
            yield f"{dof.label}: the tip moves against its motor; check the sign of the positions"
            continue
        what = f"{dof.label}: the tip moves {abs(gain):.2g} times as far as its motor"
        fits = [name for name, size in _UNITS[dof].items() if 0.6 < abs(gain) / size < 1.6]
        if fits:
            what += f"; if the positions are in {fits[0]}, type --units {dof.label}={fits[0]}"
        yield what
