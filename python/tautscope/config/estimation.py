"""Settings of the estimate of profile ``best``."""

from __future__ import annotations

from tautscope.config.fields import NonNegative, Positive
from tautscope.config.section import Section


class EstimationConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Kalman filter on fixed plays of profile ``best``, docs/best.md. All [ours].

    Lengths and travels are in the unit of each DOF, three quarters of its expected_width, so that
    one set serves all.
    """

    marker_deviation: Positive = 0.3
    """Standard deviation of a marker without a covariance [px]."""
    shape_deviation: NonNegative = 0.3
    """Standard deviation of the unevenness of the section's curvature, docs/notation.md."""
    image_deviation: NonNegative = 6.0
    """Standard deviation of a shift of the image by the camera's pose or principal point [px]."""
    misfit_deviation: NonNegative = 2.0
    """Standard deviation of what else the feature model errs [px]."""
    misfit_travel: Positive = 2.0
    """Travel within which it errs alike."""
    outlier_distance: Positive = 4.0
    """Mahalanobis distance beyond which a marker is an outlier."""
    weight_deviation: Positive = 0.2
    """Standard deviation of the weight of a play."""
    offset_deviation: NonNegative = 0.2
    """Standard deviation of the offset."""
    tip_deviation: Positive = 0.12
    """Standard deviation of the tip that is new in each image."""
    weight_travel: Positive = 800.0
    """Travel over which a weight returns to its prior."""
    offset_travel: Positive = 22.0
    """Travel over which the offset returns to its prior."""
