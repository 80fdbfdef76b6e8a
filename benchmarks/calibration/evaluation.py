"""Errors of a calibration, and of the loop with its result."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from calibration.records import Case, Floats, contradictory, noisy_features
from common.small_images import with_small_images
from scipy.spatial.transform import Rotation
from tautscope.calibration.geometry import GeometryFit, fit
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import MotionHeldError, RecordError
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Frame
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import per_dof
from tautscope.twin import Twin

LOOP_NOISE = 0.2
"""Of the features in the loop [px]."""
VARIANTS = ("none", "told", "calibrated", "exact")


@dataclass(frozen=True, slots=True)
class Job:
    """A calibration, and what is measured of it.

    Attributes:
        case: The rig.
        band_distance: Whether the distance of the bands is measured.
        loop: Whether the loop is run with the result, under an operator's motion.
        contradictions: Whether records that the model cannot explain are tried.
    """

    case: Case
    band_distance: bool = False
    loop: bool = False
    contradictions: bool = False


@dataclass(slots=True)
class Outcome:
    """What came of a job.

    Attributes:
        errors: Name of a quantity -> error, in the unit of its name.
        inside: Name of a parameter -> whether the truth is in its 95 % interval.
        found: Share of images with both bands at the first and at the last detection.
        residual: [px].
        seconds: Processor time of the fit [s].
        warnings: Of the fit.
        is_plausible: Whether the fit takes the record as explained.
        state: Variant -> standard deviation (3,) of the state estimate's error.
        hand: Variant -> RMS (3,) of true tip minus reference.
        spread: Variant -> standard deviation (3,) of the same.
        alarms: Kind of contradiction -> whether it was recognised.
    """

    errors: dict[str, float] = field(default_factory=dict)
    inside: dict[str, bool] = field(default_factory=dict)
    found: tuple[float, float] = (np.nan, np.nan)
    residual: float = np.nan
    seconds: float = np.nan
    warnings: tuple[str, ...] = ()
    is_plausible: bool = False
    state: dict[str, list[float]] = field(default_factory=dict)
    hand: dict[str, list[float]] = field(default_factory=dict)
    spread: dict[str, list[float]] = field(default_factory=dict)
    alarms: dict[str, bool] = field(default_factory=dict)


def evaluate(job: Job) -> Outcome:
    """Calibrate, and compare with the truth."""
    case, outcome = job.case, Outcome()
    told, actual, recording = case.told, case.actual, case.record()
    instrument = actual.instrument
    distance = instrument.marker_b - instrument.marker_a if job.band_distance else None
    begin = time.process_time()
    found = fit(recording, told, band_distance=distance)
    outcome.seconds = time.process_time() - begin
    outcome.found = float(recording.found.mean()), found.found_share
    outcome.residual, outcome.warnings = found.residual_px, found.warnings
    outcome.is_plausible = found.is_plausible
    outcome.errors, outcome.inside = _compare(found, actual)
    if job.loop:
        _run_loops(case, found.config, outcome)
    if job.contradictions:
        for name, wrong in contradictory(recording, told):
            try:
                outcome.alarms[name] = not fit(wrong, told).is_plausible
            except RecordError:
                outcome.alarms[name] = True
    return outcome


def _compare(found: GeometryFit, actual: Config) -> tuple[dict[str, float], dict[str, bool]]:
    """Errors with the free directions aside, and whether the intervals contain the truth."""
    fitted = found.config
    pose, truth = fitted.camera.camera_from_guide, actual.camera.camera_from_guide
    rotation = Rotation.from_rotvec(truth.rotation).as_matrix()
    channel, across = rotation[:, 2], rotation[:, :2]
    shift = np.array(pose.translation) - np.array(truth.translation)
    turned = Rotation.from_rotvec(pose.rotation).as_matrix() @ rotation.T
    turn = 0.5 * np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    )
    one, other = fitted.instrument, actual.instrument
    scale = (one.marker_b - one.marker_a) / (other.marker_b - other.marker_a)
    scaled = np.array(pose.translation) / scale - np.array(truth.translation)
    delay = fitted.camera.source.delay - actual.twin.sensor.stamp_error
    errors = {
        "angle of the channel [deg]": float(np.degrees(np.linalg.norm(across.T @ turn))),
        "position across the channel [mm]": 1e3 * float(np.linalg.norm(across.T @ scaled)),
        "the same in the drive's scale [mm]": 1e3 * float(np.linalg.norm(across.T @ shift)),
        "position along the channel [mm]": 1e3 * float(channel @ shift),
        "scale [%]": 100 * (scale - 1),
        "section [%]": 100 * (one.bending_length / other.bending_length - 1),
        "focal length [%]": 100 * (fitted.camera.fx / actual.camera.fx - 1),
        "delay [ms]": 1e3 * delay,
    }
    std, cov = found.std, found.pose_covariance
    sizes = {
        "section": (one.bending_length - other.bending_length, std["instrument.bending_length"]),
        "marker_a": (one.marker_a - other.marker_a, std["instrument.marker_a"]),
        "marker_b": (one.marker_b - other.marker_b, std["instrument.marker_b"]),
        "focal length": (fitted.camera.fx - actual.camera.fx, std["camera.fx"]),
        "delay": (delay, std["camera.source.delay"]),
    }
    for k, name in enumerate(("x", "y")):
        way = across[:, k]
        sizes[f"angle {name}"] = float(way @ turn), float(np.sqrt(way @ cov[3:, 3:] @ way))
        sizes[f"position {name}"] = float(way @ shift), float(np.sqrt(way @ cov[:3, :3] @ way))
    along = float(np.sqrt(channel @ cov[:3, :3] @ channel))
    sizes["position along"] = float(channel @ shift), along
    inside = {name: bool(abs(error) <= 1.96 * std) for name, (error, std) in sizes.items()}
    return errors, inside


def _run_loops(case: Case, calibrated: Config, outcome: Outcome) -> None:
    """Run an operator's motion with each configuration of the loop."""
    actual = case.actual
    exact = actual.replace(**{"camera.source.delay": actual.twin.sensor.stamp_error})
    configs = {"none": exact, "told": case.told, "calibrated": calibrated, "exact": exact}
    motion = OperatorMotion(case.told.experiment, case.seed)
    for name in VARIANTS:
        config = configs[name]
        delay = {"camera.source.delay": config.camera.source.delay}
        rig = Twin(with_small_images(actual.replace(**delay)), images=name != "none")
        try:
            run = run_experiment(
                rig,
                motion,
                config,
                name != "none",
                look=_FeatureUpdate(case.seed),
                engage=lambda _: True,
            )
        except MotionHeldError:
            continue
        finally:
            rig.close()
        trace = run.trace[run.trace["time"] >= EVALUATED_AFTER]
        error = per_dof(trace, "true") - per_dof(trace, "reference")
        outcome.hand[name] = np.sqrt((error**2).mean(axis=0)).tolist()
        outcome.spread[name] = error.std(axis=0).tolist()
        if name != "none":
            frames = run.frames[run.frames["captured_at"] >= EVALUATED_AFTER]
            frames = frames[np.isin(frames["status"], ("ok", "held"))]
            wrong = per_dof(frames, "estimate") - per_dof(frames, "true")
            outcome.state[name] = np.nanstd(wrong, axis=0).tolist()


class _FeatureUpdate:
    """The image update with true features and noise in place of the image."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 2])

    def __call__(self, loop: HysteresisReduction, frame: Frame) -> Report:
        features = noisy_features(frame, LOOP_NOISE, self._random)
        is_lost = np.isnan(features).all()
        return loop.on_features(None if is_lost else features, frame.captured_at)


def column(outcomes: Sequence[Outcome], kind: str, variant: str, dof: Dof) -> Floats:
    """One figure of each outcome: `kind` is ``state``, ``hand`` or ``spread``; NaN: none."""
    return np.array([getattr(each, kind).get(variant, [np.nan] * 3)[dof] for each in outcomes])
