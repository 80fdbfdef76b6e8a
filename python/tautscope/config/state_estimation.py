"""Settings of the state estimation of profile ``best``."""

from __future__ import annotations

from tautscope.config.fields import NonNegative, Positive
from tautscope.config.section import Section


class StateEstimationConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Ensemble filter of profile ``best``, decision 0030. All [ours].

    Half widths, centres and travels are in halves of the DOF's safety.width_limit, so that one set
    serves all three. A random walk has the given standard deviation over a travel of 1.
    """

    marker_deviation: Positive = 0.3
    """Standard deviation of a marker without a covariance [px]."""
    model_deviation: NonNegative = 0.3
    """Standard deviation of the feature model beyond the markers' covariance [px]."""
    shape_deviation: NonNegative = 0.3
    """Standard deviation of the unevenness of the section's curvature: half of the difference of
    its ends, over the mean."""
    image_deviation: NonNegative = 6.0
    """Standard deviation of a shift of the image, by an error of the camera's pose or principal
    point [px]."""
    outlier_distance: Positive = 4.0
    """Mahalanobis distance beyond which a marker is an outlier."""
    tip_deviation: Positive = 0.08
    """Standard deviation of the tip from the plays, by round loops and viscous friction."""
    width_deviation: Positive = 0.35
    """Standard deviation of the logarithm of the initial half width."""
    centre_deviation: NonNegative = 0.25
    """Standard deviation of the initial centre of the contact offsets [in half widths]."""
    share_deviation: NonNegative = 0.25
    """Standard deviation of the initial share of the friction that insertion and rotation have in
    common."""
    lag_deviation: NonNegative = 0.05
    """Mean and standard deviation of the initial lag of the tip behind the plays [s]."""
    tip_walk: NonNegative = 0.012
    """Random walk of the tip [in half widths]."""
    width_walk: NonNegative = 0.05
    """Random walk of the logarithm of the half width."""
    centre_walk: NonNegative = 0.012
    """Random walk of the centre [in half widths]."""
    share_walk: NonNegative = 0.02
    """Random walk of the share."""
    map_rate: tuple[NonNegative, NonNegative, NonNegative] = (0.25, 0.25, 0.0)
    """Share of the centre that its map over the position takes over per travel of 1, for each
    DOF."""
    gain_deviation: Positive = 0.3
    """Standard deviation of a gain from 1."""
