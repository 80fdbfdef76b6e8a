"""Search for the mechanical stops of a motor, at low torque."""

import time
from dataclasses import dataclass

import numpy as np

from tautscope.config import Config, DrivesConfig
from tautscope.config.servos import COUNTS_PER_TURN
from tautscope.dof import Motor
from tautscope.errors import CalibrationError, FollowingError, may_move
from tautscope.hardware.drives import Drives, open_drives
from tautscope.hardware.scale import Scale
from tautscope.hardware.servos.families import FAMILIES
from tautscope.hardware.signals import exit_on_signals

_SPEED_SHARE = 0.05
"""Speed of the search over the speed limit."""
_REACH = 1.5
"""Largest way to a stop over the width of the travel."""
_MARGIN = 0.01
"""Distance of the travel from the stops over the distance between them."""
_TOLERANCE = 0.02
"""Change of the distance between the stops that is no damage, over this distance."""


@dataclass(frozen=True, slots=True)
class Stops:
    """Mechanical stops of a motor [m or rad], at its present ``home``."""

    lower: float
    upper: float

    def changes(self, config: DrivesConfig, dof: Motor) -> dict[str, object]:
        """What the stops change in the configuration, by dotted path.

        Without stops in the configuration: the stops, and a travel between them. Else ``home``,
        so that the lower stop is where it was: the motor has forgotten its turns.

        Raises:
            CalibrationError: The distance between the stops has changed.
        """
        axis, width, path = config[dof], self.upper - self.lower, f"{dof.key}"
        if axis.stops is None:
            inside = np.clip(
                axis.travel, self.lower + _MARGIN * width, self.upper - _MARGIN * width
            )
            return {
                f"{path}.stops": [round(self.lower, 6), round(self.upper, 6)],
                f"{path}.travel": [round(float(end), 6) for end in inside],
            }
        before = axis.stops[1] - axis.stops[0]
        if abs(width - before) > _TOLERANCE * before:
            raise CalibrationError(
                f"{dof.label}: {width:.4g} between the stops, and {before:.4g} before",
                f"Look for what blocks the motor or is loose; if it is right, delete {path}.stops",
            )
        return {f"{path}.home": round(axis.home + axis.stops[0] - self.lower, 6)}


def find_stops(config: Config, dof: Motor, torque: float) -> Stops:
    """Drive a motor slowly against both stops, and back to where it was.

    THE MOTOR MOVES. Its torque is limited; the stop is where its following error becomes too large.

    Raises:
        CalibrationError: There is no stop within 1.5 times the width of the travel.
        DriveError: A drive is missing, differs from its configuration, or failed.
    """
    search = _search_config(config, dof, torque)
    assert config.drives is not None
    reach = _REACH * np.ptp(config.drives[dof].travel)
    with exit_on_signals():
        with open_drives(search) as drives:
            begin = float(drives.start()[dof])
        ends = [_seek_stop(search, dof, direction, begin, reach) for direction in (-1, 1)]
    return Stops(*ends)


def _search_config(config: Config, dof: Motor, torque: float) -> DrivesConfig:
    """The drives with little torque and a travel that ends where the motor counts no further."""
    assert config.drives is not None
    axis, path = config.drives[dof], dof.key
    limited = config.replace(**{f"{path}.stops": None, f"{path}.torque_limit": torque})
    reach = (1 + _REACH) * (axis.travel[1] - axis.travel[0])
    # A restarted servo reports a position within its first turn, wherever that is in the DOF.
    largest = FAMILIES[config.drives.protocol].largest
    counts = (0, COUNTS_PER_TURN), (-largest, largest)
    turn, most = (sorted(map(Scale(axis, dof).to_position, pair)) for pair in counts)
    lower = max(min(axis.travel[0], turn[0]) - reach, most[0])
    upper = min(max(axis.travel[1], turn[1]) + reach, most[1])
    drives = limited.replace(**{f"{path}.travel": [lower, upper]}).drives
    assert drives is not None
    return drives


def _seek_stop(
    config: DrivesConfig, dof: Motor, direction: int, begin: float, reach: float
) -> float:
    """Drive against the stop in a direction, and back to the begin; the position of the stop."""
    step = direction * _SPEED_SHARE * config[dof].speed_limit * config.cycle
    at = begin
    try:
        with open_drives(config) as drives:
            command = drives.start()
            reach = min(reach, abs(config[dof].travel[direction > 0] - command[dof]))
            for _ in range(int(reach / abs(step))):
                command[dof] += step
                at = float(_paced(drives, command)[dof])
    except FollowingError as error:
        # A motor that may still move is not started again.
        if may_move(error) or not error.node.startswith(f"{dof.label},"):
            raise
        with open_drives(config) as drives:
            command = drives.start()
            # By sign: at rest it may have been pressed deeper into the stop than the search goes.
            while direction * (command[dof] - begin) > abs(step):
                command[dof] -= step
                _paced(drives, command)
        return at
    raise CalibrationError(
        f"{dof.label}: no stop on a way of {reach:.4g} from {begin:.4g}",
        f"Give {dof.key}.travel about the width between its stops, or more torque",
    )


def _paced(drives: Drives, command: np.ndarray) -> np.ndarray:
    began = time.monotonic()
    applied = drives.exchange(command)
    time.sleep(max(0.0, drives.cycle - (time.monotonic() - began)))
    return applied
