"""Settings of one degree of freedom in the article's scheme."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from tautscope.config.fields import Fraction, Gain, Positive
from tautscope.config.section import Section


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
    """K_b: command over reference while the slack is crossed [paper]."""
    gain_limit: Gain = 5.0
    """Bound of every gain, free_gain included [paper]."""
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
