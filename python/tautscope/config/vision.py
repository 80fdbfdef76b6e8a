"""Settings of the marker detection."""

from typing import Annotated

from msgspec import Meta, field

from tautscope.config.fields import Fraction, Positive
from tautscope.config.section import Section

Weight = Annotated[float, Meta(ge=-100, le=100)]
Weights = tuple[Weight, Weight, Weight]


class OutlineFitConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fit of the bands' outlines to the edges of the marker pixels [all ours]."""

    edge_deviation: Positive = 0.5
    """Standard deviation of an edge point, neighbours taken as independent [px]."""
    edge_tolerance: Positive = 1.8
    """An edge farther than this from the fitted outline is an outlier [px]."""
    edge_reach: Positive = 9.0
    """Edges are searched up to this distance from the outline [px]."""
    growth_deviation: Positive = 1.2
    """Standard deviation of the outlines' growth by blur and by the threshold [px]."""
    growth_share: Positive = 0.06
    """And by an unknown scale [per radius of a band]."""
    growth_difference: Positive = 0.2
    """Standard deviation of the difference in growth between the two bands, which are blurred alike
    [px]."""
    growth_difference_share: Positive = 0.01
    """And by a difference in scale [per radius of a band]."""
    missing_edge_variance: Positive = 5.0
    """Increase of the variance of a band's position where all of its edges are missing, relative to
    the variance with all edges; in proportion to the missing share [1]."""


class ClearConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Scores of both bands at which the search for better candidates stops [all ours]."""

    least_edges: Fraction = 0.75
    """Share of the outline at which an edge is found. Below it, `VisionConfig.largest_surprise` is
    multiplied by the square of the ratio."""
    least_coverage: Fraction = 0.8
    """Share of the area that has the markers' colour."""
    largest_surprise: Positive = 8.0
    """Squared Mahalanobis distance from the predicted positions."""


class UnlocatedConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Search in an image of which the posture is not known [all ours]."""

    alternatives: tuple[tuple[Weights, float], ...] = (((-0.5, 1.0, -0.5), 4.0),)
    """Weights and threshold that are tried after `VisionConfig.alternatives`: for dark or smoky
    images in which a band is hardly greener than grey."""
    certain_edges: Fraction = 0.9
    """No other candidate is tried if the edge share of each band is at least this."""
    least_edges_on_average: Fraction = 0.67
    """As `VisionConfig.least_edges_on_average`."""
    least_explained: Fraction = 0.84
    """As `BlurConfig.least_explained`."""


class BlurConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Fit of the image intensity where blur has left no edges [all ours]."""

    sigma: Positive = 2.5
    """Expected standard deviation of the blur kernel [px]."""
    sigma_deviation: Positive = 2.0
    """Standard deviation of `sigma` [px]."""
    sharp_sigma: Positive = 1.0
    """Largest standard deviation of the blur kernel in a sharp image [px]."""
    margin: Positive = 14.0
    """Pixels up to this distance from the outlines are fitted [px]."""
    brightness_ratio_deviation: Positive = 0.1
    """Standard deviation of the logarithm of the ratio of the bands' brightnesses [1]."""
    unevenness: Positive = 0.015
    """Standard deviation of a band's brightness, and the least one of the tissue's colour, relative
    to their values [1]."""
    model_deviation: Positive = 0.25
    """Standard deviation of a position by what the fitted model does not describe [px]."""
    least_explained: Fraction = 0.8
    """A fit is rejected if it explains a smaller share of the variance that is not sensor noise."""
    least_contrast: Positive = 8.0
    """Or if a band's brightness is below this many standard deviations of the residuals."""
    least_brightness_ratio: Fraction = 0.6
    """Or if the ratio of the darker to the brighter band is below this."""
    largest_deviation: Positive = 1.2
    """Or if the standard deviation of a position exceeds this [px]."""


class VisionConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Marker detection, Eq. (12) and Fig. 5. All [ours]."""

    weights: Weights = (-0.525, 1.0, -0.648)
    """Fisher's discriminant: weights of blue, green, red [fitted to labelled pixels]."""
    threshold: float = 5.0
    """A pixel is marker if its weighted sum exceeds this [grey levels]."""
    alternatives: tuple[tuple[Weights, float], ...] = (
        ((-0.8, 1.0, -0.8), 5.0),
        ((-0.45, 1.0, -0.55), 8.0),
        ((-0.525, 1.0, -0.648), 40.0),
    )
    """Weights and threshold that are tried in turn where the first give no clear result: where grey
    looks green, for over-exposure, and for bands that touch in a blurred image."""
    smoothing: Annotated[int, Meta(ge=0, le=8)] = 1
    """Passes of the 3x3 binomial low-pass over the projected channel."""
    minimum_area: Annotated[int, Meta(ge=1)] = 15
    """Smaller regions are dropped [px]."""
    model_deviation: Positive = 2.5
    """Standard deviation of a predicted position of a band [px]."""
    search_margin: Positive = 12.0
    """Margin around the predicted outlines that is searched [px]."""
    least_inside: Fraction = 0.5
    """A band is rejected if less of it is inside the image [share of its area]."""
    least_coverage: Fraction = 0.4
    """Or if less of it has the markers' colour [share of its area in the image]."""
    least_exclusive: Fraction = 0.8
    """Or if less of that colour is outside the other band's outline [share of it]."""
    largest_spill: Fraction = 0.25
    """Or if more of what surrounds it has the markers' colour [share of a ring, relative to the
    coverage]."""
    least_edges: Fraction = 0.4
    """Or if less of its outline is found as edges [share of the outline]."""
    least_rims: Fraction = 0.2
    """Or if less of its two rims is: its sides do not tell the position along them."""
    least_edges_on_average: Fraction = 0.6
    """The weaker band is rejected if the mean edge share is below this."""
    least_edges_alone: Fraction = 0.85
    """A band found alone is rejected if its edge share is below this, or its coverage below 3/4 of
    it."""
    largest_surprise: Positive = 18.5
    """Largest squared Mahalanobis distance of both bands from the prediction; by chance exceeded
    once in a thousand."""
    fit: OutlineFitConfig = field(default_factory=OutlineFitConfig)
    clear: ClearConfig = field(default_factory=ClearConfig)
    unlocated: UnlocatedConfig = field(default_factory=UnlocatedConfig)
    blur: BlurConfig = field(default_factory=BlurConfig)
