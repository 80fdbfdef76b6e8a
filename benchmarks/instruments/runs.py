"""One run on a drawn instrument, and the figures of it."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from common.features import NOISE
from common.small_images import full_size, with_small_images
from instruments.properties import DrawnInstrument, draw_instrument
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import MotionHeldError
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import OperatorMotion, SineSequence
from tautscope.loop.rig import Frame
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording
from tautscope.twin import Twin

Floats = NDArray[np.float64]
Motion = Literal["hand", "sines"]
Variant = Literal["none", "paper", "best", "best exact"]
VARIANTS: tuple[Variant, ...] = ("none", "paper", "best", "best exact")
"""``none`` does not compensate; ``best exact`` is ``best`` told the geometry as it is."""
LEAST_VISIBLE = 0.5
"""A band counts as visible if at least this share of it is."""
LEAST_SEPARATION = 10.0
"""And both count only if their centres are at least this far apart; nearer, the tip is seen from
its end [px]."""
PERIODS = 2
"""The last periods of a sine count."""


@dataclass(frozen=True, slots=True)
class Run:
    """Complete description of a run.

    Attributes:
        seed: Of instrument and motion.
        motion: ``hand``, or ``sines``, the article's protocol.
        variant: Compensation, and what the loop is told.
        images: Whether the loop has images; otherwise true features with noise.
        duration: Of the operator's motion [s].
    """

    seed: int
    motion: Motion
    variant: Variant
    images: bool
    duration: float = 120.0


@dataclass(slots=True)
class Figures:
    """Figures of a run; arrays are per DOF [m, rad, rad].

    Attributes:
        spread: Standard deviation of (true tip - reference).
        shift: Mean of (true tip - reference).
        largest: Largest |true tip - reference - shift|.
        visible: Number of images with both bands visible and apart.
        statuses: Number of these images by the status of their update.
        stopped: Why the run ended early; None if it did not.
        images: Number of images.
        flags: Number of images after which each flag was in force.
    """

    spread: list[float] = field(default_factory=lambda: [np.nan] * 3)
    shift: list[float] = field(default_factory=lambda: [np.nan] * 3)
    largest: list[float] = field(default_factory=lambda: [np.nan] * 3)
    visible: int = 0
    statuses: dict[str, int] = field(default_factory=dict)
    stopped: str | None = None
    images: int = 0
    flags: dict[str, int] = field(default_factory=dict)


def simulate(run: Run) -> Figures:
    """Simulate a run."""
    instrument = draw_instrument(run.seed, "paper" if run.variant == "paper" else "best")
    config = _told(instrument, run.variant)
    reference = (
        OperatorMotion(config.experiment, run.seed, run.duration)
        if run.motion == "hand"
        else SineSequence(config.experiment)
    )
    figures = Figures()
    compensate = run.variant != "none"
    actual = instrument.actual if run.images else without_image_effects(instrument.actual)
    rig = Twin(actual, images=compensate)
    try:
        recording = run_experiment(
            rig,
            reference,
            config,
            compensate,
            look=_Look(run, figures),
            engage=lambda _: True,
        )
    except MotionHeldError as error:
        figures.stopped = str(error)
        return figures
    finally:
        rig.close()
    for dof in Dof:
        error = _tracking_error(recording, run.motion, dof)
        figures.shift[dof] = float(error.mean())
        figures.spread[dof] = float(error.std())
        figures.largest[dof] = float(np.abs(error - error.mean()).max())
    return figures


def _told(instrument: DrawnInstrument, variant: Variant) -> Config:
    return instrument.actual if variant == "best exact" else instrument.told


def without_image_effects(config: Config) -> Config:
    """Small images for the truth alone: without compression, exposure and rolling shutter."""
    return with_small_images(config).replace(
        **{
            "twin.sensor.jpeg_quality": None,
            "twin.sensor.exposure_time_constant": 0.0,
            "twin.sensor.readout": 0.0,
        }
    )


class _Look:
    """The image update, with images or with true features and noise; counts statuses and flags."""

    def __init__(self, run: Run, figures: Figures) -> None:
        self._has_images, self._figures = run.images, figures
        self._noise = np.random.default_rng([run.seed, 1])

    def __call__(self, loop: HysteresisReduction, frame: Frame) -> Report:
        assert frame.true_features is not None and frame.true_visible is not None
        is_visible = frame.true_visible >= LEAST_VISIBLE
        truth = frame.true_features
        if not self._has_images:
            truth = full_size(truth)
        if self._has_images:
            report = loop.on_frame(frame)
        else:
            features = truth + NOISE * self._noise.standard_normal(4)
            features[~np.repeat(is_visible, 2)] = np.nan
            report = loop.on_features(features if is_visible.any() else None, frame.captured_at)
        self._figures.images += 1
        for flag in loop.supervision.flags:
            self._figures.flags[flag] = self._figures.flags.get(flag, 0) + 1
        if is_visible.all() and np.hypot(*(truth[2:] - truth[:2])) >= LEAST_SEPARATION:
            self._figures.visible += 1
            status = str(report.status)
            self._figures.statuses[status] = self._figures.statuses.get(status, 0) + 1
        return report


def _tracking_error(recording: Recording, motion: Motion, dof: Dof) -> Floats:
    """True tip minus reference, while it counts."""
    trace = recording.trace
    if motion == "hand":
        counts = trace["time"] >= trace["time"][0] + EVALUATED_AFTER
    else:
        segment = next(each for each in recording.segments if each.dof is dof)
        counts = recording.during(segment, segment.periods - PERIODS, segment.periods)
    rows = trace[counts]
    return np.asarray(rows[f"true_{dof.label}"] - rows[f"reference_{dof.label}"])
