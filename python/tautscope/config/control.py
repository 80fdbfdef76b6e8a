"""Settings of the control loop: timing, both profiles, and the article's degrees of freedom."""

from typing import Annotated

from msgspec import Meta

from tautscope.config.fields import Fraction, Gain, NonNegative, Positive
from tautscope.config.section import Section, require, require_at_most

MOST_TICKS = 1024
"""Of the command history."""


class ControlConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Period and history of the control loop."""

    period: Positive = 0.005
    """Control period [s] [ours; the article states hundreds of Hz]."""
    history: Positive = 2.0
    """Length of the command history, at most 1024 ticks [s]. Older frames are rejected."""

    def _check(self) -> None:
        """The history has 1 to 1024 ticks."""
        most = MOST_TICKS * self.period
        allowed = f"{self.period:g} to {most:g}, 1 to {MOST_TICKS} of control.period"
        require(1 <= self.history / self.period <= MOST_TICKS, "history", self.history, allowed)


class DofConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One degree of freedom: its compensator, Eqs. (2)-(3), and estimator, Eqs. (4)-(6)."""

    update_distance: Positive
    """tau: command travel between two estimator updates [m or rad]; about 1 % of the stroke."""
    observable_deviation: Positive
    """Standard deviation of the state per px of marker noise beyond which the DOF is held [m/px or
    rad/px]."""
    expected_width: Positive
    """Width of the slack that is expected [m or rad]; three quarters are the unit of profile
    ``best`` [ours]."""
    start_deviation: Positive
    """Standard deviation of the tip about the reference before the first image [m or rad]; about
    half the slack [ours]."""
    free_gain: Gain = 5.0
    """K_b of profile ``paper``: command over reference while the slack is crossed [paper]."""
    gain_limit: Gain = 5.0
    """Bound of every gain of profile ``paper``, free_gain included [paper]."""
    recovery: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    """Share of the reference's travel by which the command returns to it after changed offsets
    [paper]."""
    contact_tolerance: Fraction = 0.4
    """epsilon: contact tolerance in Eq. (4) [ours]."""
    smoothing_factor: Fraction = 0.25
    """alpha: smoothing factor in Eq. (6), per update_distance travelled [ours]."""
    delta_minus: float = 0.0
    """Initial offset at the negative contact [m or rad] [paper]."""
    delta_plus: float = 0.0
    """Initial offset at the positive contact [m or rad], not below delta_minus [paper]."""

    def _check(self) -> None:
        require_at_most("", self, "free_gain", "gain_limit")
        require_at_most("", self, "delta_minus", "delta_plus")


class LawConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Vector law of profile ``best``, docs/best.md. All [ours].

    Travels are in the unit of each DOF, three quarters of its expected_width, so that one set
    serves all. delta_minus and delta_plus are those of [insertion], [rotation] and [bending].
    """

    free_gain: Gain = 20.0
    """K_b: largest speed of the command over that of the reference. The growth of its speed and
    `safety.command_speed` bound it, too."""
    tip_gain: Gain = 2.0
    """Largest speed of the predicted tip over that of the reference."""
    direction_travel: Positive = 0.02
    """Half of the travel of the reference in which its direction reverses."""
    change_rate: Positive = 0.01
    """Change of the contact offsets and of the predicted tip in use per travel of the reference, at
    most; more at the start, docs/best.md."""


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
