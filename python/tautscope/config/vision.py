"""The marker detection."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from tautscope.config.fields import Fraction, Positive, Vector3


class VisionConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Eq. (12) and Fig. 5."""

    weights: Vector3 = (-0.525, 1.0, -0.648)
    """Fisher's discriminant: weight of blue, green, red [ours, fitted on labelled pixels]."""
    threshold: float = 5.0
    """A pixel whose weighted sum exceeds this is marker [grey levels]."""
    alternatives: tuple[tuple[Vector3, float], ...] = (
        ((-0.8, 1.0, -0.8), 5.0),
        ((-0.45, 1.0, -0.55), 8.0),
        ((-0.525, 1.0, -0.648), 40.0),
    )
    """Weights and threshold to try in turn where the first give no clear verdict: for a white
    balance so green that grey looks green, for light so bright that green looks white, and for
    bands that run into each other in a blurred picture [ours]."""
    smoothing: Annotated[int, Meta(ge=0, le=8)] = 1
    """Passes of the 3x3 binomial low-pass over the projected channel; 0 is none [ours]."""
    minimum_area: Annotated[int, Meta(ge=1)] = 15
    """Regions below this are dropped [px]."""
    model_deviation: Positive = 2.5
    """Of a band from where the instrument's model has it: standard deviation [px] [ours]."""
    least_inside: Fraction = 0.5
    """A band of which less is in the image is refused [share of its area] [ours]."""
    least_coverage: Fraction = 0.4
    """A band of which less has the markers' colour is refused [share of its area] [ours]."""
    largest_spill: Fraction = 0.25
    """A band around which more has the markers' colour is refused [share of a ring, relative to its
    coverage] [ours]."""
    least_edges: Fraction = 0.4
    """A band at less of whose outline the colour ends is refused [share of it] [ours]."""
    least_edges_on_average: Fraction = 0.6
    """The same for the mean of both bands [ours]."""
    least_edges_alone: Fraction = 0.85
    """The same for a band that is found alone, and 4/3 of its coverage [ours]."""
    largest_surprise: Positive = 18.5
    """Largest squared Mahalanobis distance of the bands from where they are expected; chi squared
    with 4 degrees of freedom exceeds it once in a thousand [ours]."""
