"""What the sensors of a robot would measure in a motion, and its derivatives by parameters."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from tautscope._core import Play
from tautscope.calibration.motion import MotionRecord
from tautscope.calibration.robot.parameters import fitted, with_values
from tautscope.config import Config
from tautscope.loop.kinematics import STEP, Floats, build_kinematics, own_kinematics
from tautscope.loop.measurement import Measurement, Points, Pose, Sensors, Tip, check_rotation

PLAYS = 8
"""Parallel plays of a degree of freedom, with half widths from 0 to half of `width_limit`."""
MOST = 200
"""Measurements of a sensor that are used, evenly in time."""
BEFORE = 0.1
"""Share of the motion before the first that is used: the plays start in an unknown state."""
_STEP = 1e-4
"""Step of a difference over the standard deviation of a parameter's prior."""


class Model:
    """Values, model and derivatives of all measurements of a motion.

    The tip of a degree of freedom follows its command c through parallel plays with weights
    w >= 0:

        q(t) = zero + sum_k w_k play_k(c)(t - delay - lag),      gain = sum_k w_k.

    A lag is not negative. Loops that the plays do not describe look like one, where friction is
    shared for example, and would otherwise be found as a delay.

    Attributes:
        values: (N, M) what was measured, 0 where nothing was.
        is_seen: (N, M).
        covariance: (N, M, M) of the sensors.
        groups: (N, M) which key of [measurement] a covariance comes from, "" for the sensor's own.
        times: (N,) time stamps [s].
    """

    def __init__(self, record: MotionRecord, config: Config, keep: Sequence[str]) -> None:
        self.config, self.parameters = config, fitted(config, record.measurements, keep)
        self._record, self.signs = record, np.ones(len(config.dof))
        self.own = used_measurements(record)
        sensors = Sensors(config, build_kinematics(config))
        self.readings = [sensors.reading(each) for each in self.own]
        count, most = len(self.own), max(len(each.values) for each in self.readings)
        self.values = np.full((count, most), np.nan)
        self.covariance = np.tile(np.eye(most), (count, 1, 1))
        self.groups = np.full((count, most), "", dtype=object)
        for k, (one, reading) in enumerate(zip(self.own, self.readings, strict=True)):
            m = len(reading.values)
            self.values[k, :m] = reading.values
            self.covariance[k, :m, :m] = reading.covariance
            self.groups[k, :m] = _groups(one, m)
        self.is_seen = np.isfinite(self.values)
        self.values[~self.is_seen] = 0.0
        self.times = np.array([each.captured_at for each in self.own])
        is_pose = np.array([isinstance(each, Pose) for each in self.own], dtype=np.bool_)
        self._poses, self._others = np.flatnonzero(is_pose), np.flatnonzero(~is_pose)
        given = [each.orientation for each in self.own if isinstance(each, Pose)]
        turned = [np.eye(3) if each is None else check_rotation(each) for each in given]
        self._turned = np.array(turned if any(each is not None for each in given) else [])
        self._last: tuple[object, tuple[Floats, Floats]] | None = None
        self._sensor = np.array([each.sensor for each in self.own])
        limits = np.array([dof.width_limit for dof in config.dof])
        self.half_widths = np.outer(limits, np.linspace(0.0, 0.5, PLAYS))
        self._plays = [
            [Play(delta_minus=-r, delta_plus=r, output=float(c[0])).run(c) for r in half_widths]
            for c, half_widths in zip(record.commands.T, self.half_widths, strict=True)
        ]
        self.names = [each.name for each in self.parameters]
        self.weights_from = len(self.names)

    def start(self) -> Floats:
        """Parameters at their starts, then the weights (n, PLAYS) of the plays."""
        own = [each.start for each in self.parameters]
        return np.array([*own, *[1.0 / PLAYS] * self.half_widths.size])

    def motion(self, p: Floats) -> tuple[Floats, Floats]:
        """States (N, n), and plays (N, n, PLAYS) by whose weights they change."""
        known = dict(zip(self.names, p.tolist(), strict=False))
        given = (*self.config.measurement.delays, *[0.0] * 4)
        delays = [known.get(f"measurement.delays[{k}]", given[k]) for k in self._sensor]
        shown, names = self.times - delays, [dof.name for dof in self.config.dof]
        plays = np.empty((len(shown), *self.half_widths.shape))
        for index, name in enumerate(names):
            at = shown - known.get(f"dof.{name}.lag", 0.0)
            for column, play in zip(plays[:, index].T, self._plays[index], strict=True):
                column[:] = np.interp(at, self._record.times, play)
        plays *= self.signs[:, None]
        weights = p[self.weights_from :].reshape(plays.shape[1:])
        zeros = [known.get(f"dof.{name}.zero", 0.0) for name in names]
        return np.sum(plays * weights, axis=2) + zeros, plays

    def predict(self, p: Floats, states: Floats) -> Floats:
        """(N, M) values that would be measured in states (N, n), 0 where nothing was."""
        changes = with_values(self.config, dict(zip(self.names, p.tolist(), strict=False)))
        own = {key: each for key, each in changes.items() if key.startswith("kinematics.")}
        config = self.config.replace(**own) if own else self.config
        found = np.zeros(self.values.shape)
        if self._poses.size:
            kinematics = config.kinematics
            base, sensor = (
                Rotation.from_rotvec(each).as_matrix()
                for each in (kinematics.base_rotation, kinematics.sensor_rotation)
            )
            places, turned = self._tips(config, states[self._poses])
            found[self._poses, :3] = kinematics.base_position + places @ base.T
            if self._turned.size:
                relative = np.swapaxes(self._turned, 1, 2) @ base @ turned @ sensor
                found[self._poses, 3:6] = Rotation.from_matrix(relative).as_rotvec()
        for index in self._others:
            reading = self.readings[index]
            found[index, : len(reading.values)] = reading.predict(states[index])
        return np.where(self.is_seen, found, 0.0)

    def by_state(self, p: Floats, states: Floats) -> Floats:
        """(N, M, n) derivatives of the values by the states."""
        here, steps = self.predict(p, states), STEP * np.diag(2 * self.half_widths[:, -1])
        columns = [(self.predict(p, states + step) - here) / step.max() for step in steps]
        return np.stack(columns, axis=2)

    def jacobian(self, p: Floats) -> Floats:
        """(N, M, parameters and weights) derivatives of the values."""
        states, plays = self.motion(p)
        by_state = self.by_state(p, states)
        columns = np.zeros((*self.values.shape, len(p)))
        here = self.predict(p, states)
        for index, each in enumerate(self.parameters):
            step = np.zeros(len(p))
            step[index] = _STEP * each.std
            if each.name.startswith("kinematics."):
                columns[:, :, index] = (self.predict(p + step, states) - here) / step[index]
            else:
                ahead, behind = (self.motion(p + way)[0] for way in (step, -step))
                by_step = (ahead - behind) / (2 * step[index])
                columns[:, :, index] = np.einsum("kmn,kn->km", by_state, by_step)
        by_weights = by_state[:, :, :, None] * plays[:, None]
        columns[:, :, self.weights_from :] = by_weights.reshape(*self.values.shape, -1)
        return columns

    def _tips(self, config: Config, states: Floats) -> tuple[Floats, Floats]:
        """Positions (N, 3) and rotations (N, 3, 3) in the frame of the kinematics.

        The last are kept: most parameters change nothing of them.
        """
        own = config.kinematics
        key = (own.length, own.tip_length, own.skew, states.tobytes())
        if self._last is None or self._last[0] != key:
            kinematics = own_kinematics(config)
            found = [kinematics.tip(state) for state in states] if kinematics is not None else []
            places, turned = zip(*found, strict=True)
            self._last = key, (np.array(places), np.array(turned))
        return self._last[1]


def used_measurements(record: MotionRecord) -> list[Measurement]:
    """The measurements that are used, of each sensor at most `MOST` evenly."""
    span = record.times[-1] - record.times[0]
    after = record.times[0] + BEFORE * span
    found = [each for each in record.measurements if each.captured_at > after]
    own = [[each for each in found if each.sensor == k] for k in {each.sensor for each in found}]
    kept = [each for of in own for each in of[:: -(-len(of) // MOST)]]
    return sorted(kept, key=lambda each: each.captured_at)


def _groups(measurement: Measurement, count: int) -> list[str]:
    if measurement.covariance is not None or isinstance(measurement, Tip):
        return [""] * count
    if isinstance(measurement, Points):
        return ["point_deviation"] * count
    return (["position_deviation"] * 3 + ["orientation_deviation"] * 3)[:count]
