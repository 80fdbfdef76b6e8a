"""Settings of the state estimation of profile ``best``."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from tautscope.config.fields import NonNegative, Positive


class StateEstimationConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Weighted state estimation of profile ``best``, decision 0018. All [ours]."""

    marker_deviation: Positive = 0.3
    """Standard deviation of a marker without a covariance [px]."""
    model_deviation: NonNegative = 0.3
    """Standard deviation of the feature model beyond the markers' covariance [px]."""
    sideways_deviation: NonNegative = 0.3e-3
    """Standard deviation of the tip's displacement across the bend by uneven curvature of the
    bending section [m]."""
    outlier_distance: Positive = 4.0
    """Mahalanobis distance beyond which a marker is an outlier."""
    steps: Annotated[int, Meta(ge=1, le=100)] = 12
    """Gauss-Newton steps, at most."""
    rest_deviation: NonNegative = 0.25
    """Standard deviation of the motion of a tip between two images while its command rests [in
    update_distance of the DOF]."""
    settling_time: NonNegative = 0.15
    """Time constant with which a tip comes to rest after its command [s]."""
