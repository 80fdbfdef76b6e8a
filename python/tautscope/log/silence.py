"""The flag ``dropped`` between the updates of a log, whose ticks have no flags."""

import numpy as np

from tautscope.config import Config
from tautscope.loop.kinematics import Floats
from tautscope.loop.safety import Reaction

_UNSEEN = 0.25
"""Travel after which a first measurement is due, as `UNSEEN` of the core [width_limit]."""


class Silence:
    """Reaction to missing measurements, by the rules of the core's monitors and supervisor.

    ``dropped`` is raised ``frame_gap`` after the newest measurement of all sensors; where there was
    none, ``frame_age`` later, after some motion. It fades after ``hold_time`` or ``hold_travel``.
    """

    def __init__(self, config: Config) -> None:
        self._safety = config.safety
        self._unit = np.array([dof.width_limit for dof in config.dof] or config.safety.width_limit)
        self._limit = config.safety.frame_gap + config.safety.frame_age
        self._is_first, self._arrived, self._travel = True, 0.0, 0.0
        self._reference: Floats | None = None
        self._since: tuple[float, float] | None = None

    def end(self, now: float, *, is_dropped: bool = False) -> None:
        """An update arrived at a time [s]; `is_dropped` if the flag is in force after it."""
        self._is_first, self._arrived, self._limit = False, now, self._safety.frame_gap
        if not is_dropped:
            self._since = None

    def update(self, now: float, reference: Floats) -> Reaction:
        """The reaction after a tick at a time [s] with a reference (n,) [m or rad]."""
        if self._reference is not None:
            self._travel += float((np.abs(reference - self._reference) / self._unit).sum())
        self._reference = reference
        if self._is_first and self._travel <= _UNSEEN:
            self._arrived = now
        if now - self._arrived <= self._limit or "dropped" in self._safety.off:
            return Reaction.NONE
        if self._since is None:
            self._since = now, self._travel
        since, travel = self._since
        is_over = now - since >= self._safety.hold_time
        is_over |= self._travel - travel >= self._safety.hold_travel
        return Reaction.FADE if is_over else Reaction.HOLD_ESTIMATE
