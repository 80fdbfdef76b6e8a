"""Settings of the compensation law of profile ``best``."""

from __future__ import annotations

from tautscope.config.fields import Gain, Positive
from tautscope.config.section import Section


class LawConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Vector law of profile ``best``, docs/best.md. All [ours].

    Travels are in the unit of each DOF, three quarters of its expected_width, so that one set
    serves all. free_gain, gain_limit, delta_minus and delta_plus are those of `DofConfig`.
    """

    tip_gain: Gain = 2.0
    """Largest speed of the predicted tip over that of the reference."""
    direction_travel: Positive = 0.02
    """Half of the travel of the reference in which its direction reverses."""
    change_rate: Positive = 0.01
    """Largest lasting change of the contact offsets and of the predicted tip, per travel of the
    reference."""
