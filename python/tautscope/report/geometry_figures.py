"""Figure and overlay video of a geometry calibration."""

from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tautscope._core import FeatureModel
from tautscope.calibration.geometry import GeometryFit
from tautscope.calibration.images import to_bgr
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import OutputError
from tautscope.figure_style import BLUE, GREY, ORANGE, PAGE, style
from tautscope.loop.construction import build_feature_model

VIDEO_RATE = 12.5
_COLOURS = ((178, 114, 0), (0, 94, 213))


def residual_figure(fit: GeometryFit) -> Figure:
    """Residuals of the features over time, and the tip over the motor of each DOF."""
    recording = fit.recording
    captured_at, clock = recording.captured_at, recording.time
    time = captured_at - captured_at[0]
    motors = np.stack([np.interp(captured_at, clock, each) for each in recording.motors.T], axis=1)
    with style():
        figure = Figure(figsize=(PAGE, 4.2), layout="constrained")
        upper, lower = figure.subfigures(2, 1, height_ratios=(1, 1.2), squeeze=False).flat
        for axis, band, name in zip(upper.subplots(1, 2, sharey=True), (0, 2), "AB", strict=True):
            for offset, colour, label in ((0, BLUE, "u"), (1, ORANGE, "v")):
                residual = fit.residuals[:, band + offset]
                axis.plot(time, residual, ".", ms=2, color=colour, label=label)
            axis.axhline(0, color=GREY, lw=0.5)
            axis.set(title=f"Band {name}", xlabel="time [s]", ylabel="measured - predicted [px]")
            axis.legend(loc="upper right", markerscale=4)
        for axis, dof in zip(lower.subplots(1, 3), Dof, strict=True):
            scale, unit = dof.display_scale, dof.display_unit
            motor, model, found = (
                scale * each[:, dof] for each in (motors, fit.expected, fit.states)
            )
            axis.plot(motor, model, color=GREY, lw=0.6, label="play")
            axis.plot(motor, found, ".", ms=1.5, color=BLUE, label="images")
            axis.set(title=dof.label.capitalize(), xlabel=f"motor [{unit}]", ylabel=f"tip [{unit}]")
        lower.axes[Dof.ROTATION].legend(loc="upper left", markerscale=4)
    return figure


def write_overlay(fit: GeometryFit, before: Config, file: Path) -> None:
    """Write a video (Motion JPEG, AVI) of the images with the predicted outlines of the bands.

    Orange: with the geometry before; blue: with the fitted one; both at the fitted tip.

    Raises:
        OutputError: The file cannot be written.
    """
    camera = before.camera
    size = (camera.width, camera.height)
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), VIDEO_RATE, size)
    if not writer.isOpened():
        raise OutputError("overlay", str(file), "a file that OpenCV can write as AVI")
    models = build_feature_model(fit.config), build_feature_model(before)
    try:
        for patch, state in zip(fit.recording.patches, fit.states, strict=True):
            image = to_bgr(patch.image(camera), camera.pixel_format).copy()
            for model, colour in zip(models, _COLOURS, strict=True):
                _draw_outlines(image, model, state, colour)
            writer.write(image)
    finally:
        writer.release()


def _draw_outlines(
    image: NDArray[np.uint8],
    model: FeatureModel,
    state: NDArray[np.float64],
    colour: tuple[int, int, int],
) -> None:
    if not np.isfinite(state).all() or (bands := model.bands(state)) is None:
        return
    outlines = [np.round(16 * outline).astype(np.int32) for *_, outline in bands]
    cv2.polylines(image, outlines, True, colour, 1, cv2.LINE_AA, 4)
