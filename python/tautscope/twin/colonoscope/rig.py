"""The simulated colonoscope behind the `Rig` interface."""

import numpy as np
from numpy.typing import ArrayLike

from tautscope.errors import SignalError
from tautscope.loop.rig import Sample
from tautscope.twin.colonoscope.parameters import ColonoscopeParameters
from tautscope.twin.colonoscope.plant import Plant
from tautscope.twin.colonoscope.tracker import EmTracker

CONTROL_PERIOD = 0.005
"""Time from one command to the next [s]."""


class ColonoscopeTwin:
    """The steerable tip of a colonoscope simulated in MuJoCo, with an EM tracker; implements `Rig`.

    The degrees of freedom are bend_x [rad], bend_y [rad] and insertion [m], in this order. The
    command is that of the motors: 1 rad of bend_x is the position of the knob at which a
    transmission without friction and elasticity would bend the section by 1 rad in that plane.
    Friction and elasticity cause the hysteresis. The same seed gives the same values.

    The tip's orientation, but for its roll, is exactly the rotation by the angle |b| about
    (-b_y, b_x, 0)/|b| with the bending vector b = (bend_x, bend_y). Its position is approximately
    that of a section of constant curvature (Webster and Jones, Int. J. Robotics Research 29, 2010)
    with `ColonoscopeParameters.length`, then `tip_length` straight on, from (0, 0, insertion).

    `Sample.measurement` has the `Pose` of the tip that arrived in a control period, if any.

    Args:
        seed: Decides the parameters, unless they are given, and the tracker's noise.
        parameters: Of the instrument; without them `ColonoscopeParameters.drawn(seed)`.
        start: (3,) command [rad, rad, m] at which it starts.
        delay: Time from a measurement to its arrival [s].
        told_delay: The delay that the measurements' time stamps assume [s]; without it `delay`.
        drift: Largest drift of the measured position [m].

    Wrong when inertia matters (inertias are raised for the time step), or when tip or shaft are
    pressed against tissue.

    Raises:
        SignalError: `start` is not three finite numbers.
    """

    control_period = CONTROL_PERIOD

    def __init__(
        self,
        seed: int = 0,
        *,
        parameters: ColonoscopeParameters | None = None,
        start: ArrayLike = (0.0, 0.0, 0.0),
        delay: float = 0.05,
        told_delay: float | None = None,
        drift: float = 0.0,
    ) -> None:
        self._seed = seed
        self.parameters = parameters or ColonoscopeParameters.drawn(seed)
        self._start = _checked("start", start)
        self._delay, self._told_delay, self._drift = delay, told_delay, drift
        self._plant: Plant | None = None
        self._ticks = 0

    def __repr__(self) -> str:
        clock = "closed" if self._plant is None else f"at {self.time:.3f} s"
        return f"<ColonoscopeTwin: seed {self._seed}, {clock}>"

    @property
    def time(self) -> float:
        """Time of its clock [s]."""
        return self._ticks * CONTROL_PERIOD

    @property
    def plant(self) -> Plant:
        """The simulated plant, for inspection; a `SignalError` before `reset` or after `close`."""
        if self._plant is None:
            raise SignalError("rig", "closed", "a twin after reset() and before close()")
        return self._plant

    def reset(self) -> Sample:
        """Start with a new instrument, settled at the start command, at time 0."""
        generator = np.random.default_rng([self._seed, 2])
        self._plant = Plant(self.parameters, CONTROL_PERIOD, self._start)
        self._tracker = EmTracker(generator, self._delay, self._told_delay, self._drift)
        self._ticks = 0
        return self._sample(self._plant)

    def step(self, command: ArrayLike) -> Sample:
        """Send command (3,) [rad, rad, m] and let one control period pass.

        Raises:
            SignalError: The command is not three finite numbers.
        """
        plant = self.plant
        plant.step(_checked("command", command))
        self._ticks += 1
        return self._sample(plant)

    def close(self) -> None:
        """Release the simulation; `reset` starts a new one."""
        self._plant = None

    def _sample(self, plant: Plant) -> Sample:
        time = self.time
        if self._tracker.is_due(time):
            position, rotation = plant.tip()
            self._tracker.measure(time, position, rotation[:, 2])
        pose = self._tracker.arrived(time)
        measurements = () if pose is None else (pose,)
        return Sample(time, plant.applied, None, plant.true_state, measurements)


def _checked(field: str, values: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    found = np.asarray(values, dtype=np.float64)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise SignalError(field, values, "three finite numbers [rad, rad, m]")
    return found
