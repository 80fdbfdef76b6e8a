"""Checks of a calibration record, and of the result: the cases in which it must not be used."""

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.delay import moving
from tautscope.calibration.geometry.model import Model
from tautscope.calibration.geometry.parameters import IMAGE, PARAMETERS
from tautscope.calibration.geometry.recording import Recording
from tautscope.calibration.geometry.solver import Solution
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import RecordError

LEAST_IMAGES = 100
"""Images with both bands."""
LEAST_SHARE = 0.25
"""Of the images that show both bands."""
LARGEST_SATURATED = 0.25
"""Median share of saturated pixels around the bands."""
LEAST_TRAVEL = 0.8
"""Travel of each motor, as a share of `safety.width_limit`: less does not cross the slack."""
LEAST_TIME = 40.0
"""Time in which motors move, below which a result is less certain than it says [s]."""
LEAST_SPREAD = 5.0
"""Standard deviation of the features [px]."""
LARGEST_RESIDUAL = 3.0
"""A feature farther than this from its prediction is not explained [px]."""
LARGEST_UNEXPLAINED = 0.1
"""Share of images with such a feature above which the model does not explain the record."""
LARGEST_DEVIATION = 0.12
"""Root mean square deviation of the tip from its expectation, as a share of `width_limit`."""
LARGEST_DIFFERENCE = 4.0
"""From the configuration, and between the fit and that with free states [standard deviations]."""
LARGEST_LAST_STEP = 0.5
"""Of the solver [standard deviations]."""
ELASTIC_SHARE = 0.15
"""Elastic share of insertion above which scale and delay depend on how it is modelled."""
LARGEST_MISFIT = 0.025
"""Root mean square deviation of insertion from its expectation, as a share of `width_limit`, above
which a play does not describe its loops; 0.016 to 0.020 on twins."""
UNDETERMINED = 0.9
"""Ratio of a standard deviation to that before the fit above which a value is not determined."""


def check_record(recording: Recording, config: Config) -> None:
    """Check that a record can determine the geometry.

    Raises:
        RecordError: It cannot; the error says what is missing and what to do.
    """
    if recording.saturated > LARGEST_SATURATED:
        raise RecordError(
            "recording",
            f"{recording.saturated:.0%} of the pixels around the bands are saturated",
            f"at most {LARGEST_SATURATED:.0%}: lower the light or the camera's exposure",
        )
    found, images = int(recording.found.sum()), len(recording.captured_at)
    if found < LEAST_IMAGES or found < LEAST_SHARE * images:
        reason = next(iter(recording.reasons), "no reason recorded")
        raise RecordError(
            "recording",
            f"both bands in {found} of {images} images ({reason})",
            f"both in at least {LEAST_IMAGES} images and {LEAST_SHARE:.0%} of them; is the tip in "
            "view, and is [vision] fitted to the bands (tautscope calibrate colour)?",
        )
    travel = np.ptp(recording.motors, axis=0)
    for dof, limit in zip(Dof, config.safety.width_limit, strict=True):
        if travel[dof] < LEAST_TRAVEL * limit:
            scale, unit = dof.display_scale, dof.display_unit
            raise RecordError(
                f"recording.motors.{dof.label}",
                f"a travel of {scale * travel[dof]:.3g} {unit}",
                f"at least {scale * LEAST_TRAVEL * limit:.3g} {unit}, more than its slack; does "
                "the drive report its position, are the motors in the order insertion, rotation, "
                f"bending, and is experiment.{dof.label}.amplitude large enough?",
            )
    spread = float(np.nanstd(recording.features, axis=0).max())
    if spread < LEAST_SPREAD:
        raise RecordError(
            "recording.features",
            f"bands that move by {spread:.2g} px",
            f"at least {LEAST_SPREAD:g} px; is the image frozen, or the instrument not coupled?",
        )


def shortness(recording: Recording) -> str:
    """What a short record makes uncertain; empty if it is long enough."""
    is_moving = moving(recording.time, recording.motors).any(axis=1)
    moved = float(np.diff(recording.time)[is_moving].sum())
    if moved >= LEAST_TIME:
        return ""
    return (
        f"The motors moved for only {moved:.0f} s: lengths and focal length may be wrong by far "
        f"more than their standard deviations say. Move for a minute, {LEAST_TIME:.0f} s at least"
    )


def find_doubts(
    model: Model, solution: Solution, free: Solution, active: NDArray[np.bool_]
) -> tuple[list[str], list[str]]:
    """Reasons why the result must not be used, and other warnings, in words."""
    doubts, warnings = [], []
    unexplained = ~(np.abs(solution.residuals).max(axis=1) < LARGEST_RESIDUAL)
    share = float(unexplained.mean())
    if share > LARGEST_UNEXPLAINED:
        doubts.append(
            f"The model does not explain {share:.0%} of the images to {LARGEST_RESIDUAL:g} px: "
            "is the image mirrored, are the bands A and B exchanged, or is an axis's sign wrong?"
        )
    deviation = np.sqrt(np.mean((solution.states - solution.expected)[:, :3] ** 2, axis=0))
    limits = LARGEST_DEVIATION * model.width_limit
    for dof in Dof:
        if deviation[dof] > limits[dof]:
            scale, unit = dof.display_scale, dof.display_unit
            doubts.append(
                f"The tip's {dof.label} deviates from what its motor lets expect by "
                f"{scale * deviation[dof]:.2g} {unit} RMS: are the motors in the order insertion, "
                "rotation, bending, with the right signs, and all coupled?"
            )
    if model.is_scale_of_drive and (misfit := _misfit(model, solution, float(deviation[0]))):
        warnings.append(
            f"{misfit}: scale and delay are less certain than their standard deviations say. "
            "Measure the distance of the bands' centres and give it as --band-distance"
        )
    if solution.last_step > LARGEST_LAST_STEP:
        doubts.append("The fit did not converge")
    std = np.sqrt(np.diag(solution.covariance))
    for index in np.flatnonzero(active):
        parameter, size = PARAMETERS[index], abs(float(solution.z[index]))
        change = size * model.prior_std[index] * parameter.shown
        if size > LARGEST_DIFFERENCE and IMAGE.start <= index < IMAGE.stop:
            doubts.append(
                f"{parameter.name} would change by {change:.3g} "
                f"{parameter.unit}, {size:.1f} standard deviations of what is plausible"
            )
        elif parameter.name.startswith("camera.camera") and std[index] > UNDETERMINED:
            warnings.append(f"{parameter.name} is hardly determined by this motion")
    if contradiction := _contradiction(solution, free, active):
        doubts.append(contradiction)
    return doubts, warnings


def _misfit(model: Model, solution: Solution, deviation: float) -> str:
    """What of insertion's hysteresis a play does not describe; empty if nothing."""
    if (share := model.elastic_share(solution.z)) > ELASTIC_SHARE:
        return f"Within its play the tip follows {share:.0%} of the insertion drive's travel"
    if deviation > LARGEST_MISFIT * model.width_limit[Dof.INSERTION]:
        return f"Insertion deviates by {1e3 * deviation:.2g} mm RMS from its model of hysteresis"
    return ""


def _contradiction(solution: Solution, free: Solution, active: NDArray[np.bool_]) -> str:
    """Where the fit with free states contradicts the one with the motors' expectation."""
    std = np.sqrt(np.maximum(np.diag(free.covariance), 1e-12))
    difference = np.abs(free.z - solution.z) / std
    index = int(np.argmax(np.where(active[: IMAGE.stop], difference[: IMAGE.stop], 0.0)))
    if difference[index] <= LARGEST_DIFFERENCE:
        return ""
    return (
        f"{PARAMETERS[index].name} from the images alone differs from that with the motors by "
        f"{difference[index]:.1f} standard deviations"
    )
