"""The colour of the bands from labelled images, and whether it can be told from the rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import cv2
import numpy as np
from matplotlib.figure import Figure

from tautscope.calibration.bands.labels import BACKGROUND, BAND_A, BAND_B, LabelledImage
from tautscope.calibration.colour import fit_discriminant
from tautscope.calibration.images import Image
from tautscope.calibration.result import CalibrationResult
from tautscope.errors import CalibrationError
from tautscope.figure_style import BLACK, GREEN, GREY

LEAST_HITS = 0.8
"""Share of the pixels of each band that must be classified as marker."""
LARGEST_ERRORS = 0.02
"""Largest share of the other pixels."""
LEAST_SPLIT = 10
_MOST_PIXELS = 400_000
_CAPTION = (
    "Left: pixels labelled as bands (outlined). Right: distribution of the discriminant w . x on "
    "the bands and on everything else, and the threshold."
)


@dataclass(frozen=True)
class ColourFit:
    """A discriminant and its errors on labelled pixels.

    Attributes:
        weights: w for B, G, R; `vision.weights`.
        threshold: `vision.threshold` [grey levels].
        hits: Share of the pixels of each labelled band that are classified as marker.
        errors: Share of all other pixels.
        separation: Distance of the means of w . x over the root of their mean variance [1].
    """

    weights: tuple[float, float, float]
    threshold: float
    hits: tuple[float, ...]
    errors: float
    separation: float


def fit_colour(images: Sequence[LabelledImage]) -> ColourFit:
    """Fit the discriminant to every other image, and check it on the others.

    Fewer than `LEAST_SPLIT` images serve for both.

    Raises:
        CalibrationError: A band, or everything else, is not classified as it should.
    """
    train, check = (images[::2], images[1::2]) if len(images) >= LEAST_SPLIT else (images, images)
    labels = [label for label in (BAND_A, BAND_B) if any((i.labels == label).any() for i in check)]
    if not labels:
        raise CalibrationError(
            "No pixel of the bands is left: they are overexposed, or smaller than their edges",
            "Reduce the light or the exposure, and bring the bands closer",
        )
    marker = np.concatenate([_of(train, BAND_A), _of(train, BAND_B)])
    weights, threshold = fit_discriminant(marker, _of(train, BACKGROUND))
    bands = [_of(check, label) @ np.array(weights) for label in labels]
    inside, outside = np.concatenate(bands), _of(check, BACKGROUND) @ np.array(weights)
    hits = tuple(float((band > threshold).mean()) for band in bands)
    errors = float((outside > threshold).mean())
    spread = np.sqrt((inside.var() + outside.var()) / 2)
    separation = float((inside.mean() - outside.mean()) / max(spread, 1e-9))
    fit = ColourFit(weights, threshold, hits, errors, separation)
    _check(fit)
    return fit


def colour_result(
    images: Sequence[LabelledImage], serial_numbers: Mapping[str, str] = MappingProxyType({})
) -> CalibrationResult:
    """The result of `fit_colour` in the form that all calibrations have."""
    fit = fit_colour(images)
    values = {
        "vision.weights": tuple(round(float(weight), 4) for weight in fit.weights),
        "vision.threshold": round(float(fit.threshold), 2),
    }
    shares = " and ".join(f"{share:.1%}" for share in fit.hits)
    notes = (
        f"classified as marker: {shares} of the bands, {fit.errors:.2%} of everything else",
        f"separation {fit.separation:.1f} standard deviations; {len(images)} images",
    )
    data = {
        "bands_classified_as_marker": min(fit.hits),
        "background_classified_as_marker": fit.errors,
        "separation": fit.separation,
    }
    figures = ((_figure(fit, images), _CAPTION),)
    return CalibrationResult("colour", values, {}, None, serial_numbers, notes, figures, data)


def _of(images: Sequence[LabelledImage], label: int) -> Image:
    """The pixels (n, 3) of a label in all images, at most `_MOST_PIXELS`."""
    pixels = np.concatenate([image.pixels(label) for image in images])
    return np.asarray(pixels[:: max(-(-len(pixels) // _MOST_PIXELS), 1)], np.uint8)


def _check(fit: ColourFit) -> None:
    remedy = "Matt green or blue bands are best; light them without overexposure, and label again"
    for name, hits in zip(("first", "second"), fit.hits, strict=False):
        if hits < LEAST_HITS:
            which = f"the {name} band" if len(fit.hits) > 1 else "the bands"
            raise CalibrationError(
                f"The colour of {which} cannot be told from the rest of the image: {hits:.0%} of "
                f"its pixels are classified as marker, at least {LEAST_HITS:.0%} are needed",
                remedy,
            )
    if fit.errors > LARGEST_ERRORS:
        raise CalibrationError(
            f"The colour of the bands cannot be told from the rest of the image: {fit.errors:.1%} "
            f"of its pixels are classified as marker, at most {LARGEST_ERRORS:.0%} are allowed",
            remedy,
        )


def _figure(fit: ColourFit, images: Sequence[LabelledImage]) -> Figure:
    middle = images[len(images) // 2]
    shown = middle.image[..., ::-1].copy()
    is_band = ((middle.labels == BAND_A) | (middle.labels == BAND_B)).astype(np.uint8)
    outlines, _ = cv2.findContours(is_band, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(shown, outlines, -1, (255, 255, 0), 1)
    figure = Figure(figsize=(9, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.imshow(shown)
    left.set_axis_off()
    weights = np.array(fit.weights)
    groups = {"bands": (BAND_A, BAND_B), "everything else": (BACKGROUND,)}
    for (name, labels), colour in zip(groups.items(), (GREEN, GREY), strict=True):
        pixels = np.concatenate([_of(images, label) for label in labels])
        values = pixels @ weights
        share = np.full(len(values), 1 / max(len(values), 1))
        right.hist(values, bins=120, weights=share, label=name, color=colour, alpha=0.7)
    right.axvline(fit.threshold, color=BLACK, linewidth=1, label="threshold")
    right.set(xlabel="w . x [grey levels]", ylabel="share of the pixels", yscale="log")
    right.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return figure
