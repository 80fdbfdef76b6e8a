"""State estimation of profile ``best``."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from tautscope.config.fields import NonNegative, Positive


class StateEstimationConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """State estimation of profile ``best``, decision 0018. All [ours]."""

    marker_deviation: Positive = 0.3
    """Of a marker that comes without a covariance: standard deviation [px]."""
    model_deviation: NonNegative = 0.3
    """What the model of the features is off by beyond the markers' covariance: standard deviation
    [px]."""
    sideways_deviation: NonNegative = 0.3e-3
    """How far the tip is displaced across the bend because the section does not bend evenly:
    standard deviation [m]."""
    outlier_distance: Positive = 4.0
    """Mahalanobis distance beyond which a marker is left out."""
    steps: Annotated[int, Meta(ge=1, le=100)] = 12
    """Gauss-Newton steps, at most."""
    rest_deviation: NonNegative = 0.25
    """How far a tip moves between two images while its command rests: standard deviation [in units
    of the DOF's update_distance]."""
    settling_time: NonNegative = 0.15
    """How long a tip still moves after its command has come to rest: time constant [s]."""
