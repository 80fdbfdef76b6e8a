"""Record and static model of a real tendon-driven continuum robot of three segments.

The record is not in the repository. Each of nine tendons ends at a segment and passes those before.
"""

import csv
from dataclasses import dataclass

import numpy as np
from common.paths import DATA
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
FILE = DATA / "opencr" / "ftdcr_v4_keypoints.csv"
SEGMENTS, TENDONS = 3, 9
ANGLES = np.radians([0, 120, 240, 30, 150, 270, 60, 180, 300])
"""Of the tendons about the axis, three per segment; which segment is bent where shows them."""
SOFT = 0.5
"""Motion within which a tendon becomes slack [mm]."""
MODEL_ERROR = 5e-3
"""Of the static model [m]."""


@dataclass(frozen=True, eq=False)
class Record:
    """Motion of the robot.

    Attributes:
        servos: Pull of the tendons (n, 9), in the order of the columns [mm].
        tip: (n, 3), by motion capture [m].
    """

    servos: Floats
    tip: Floats

    def __len__(self) -> int:
        return len(self.servos)


def read() -> Record:
    """The record."""
    with FILE.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name.startswith("servo")]
    servos = np.array([[float(row[name]) for name in names] for row in rows])
    tip = np.array([[float(row[f"tip_{axis}"]) for axis in "xyz"] for row in rows])
    return Record(servos, 1e-3 * tip)


@dataclass(frozen=True, eq=False)
class Robot:
    """Where the tip is, by the tendons and without memory.

    The bending angles of the segments are linear in the tendons' pulls, but for slack ones:

        q = rest + by_tendon v,     v = softplus(u - slack), from that of u = 0

    Wrong where forces couple the tendons.

    Attributes:
        by_tendon: dq/dv (6, 9): x and y of each segment in turn [rad/mm].
        rest: q (6,) at no pull [rad].
        slack: Pull (9,) below which a tendon does not push [mm].
        lengths: Of a segment, and of the rigid tip [m].
        place: Of the robot's base (3,) in the frame of the motion capture [m].
        turn: Rotation vector (3,) of the base [rad].
    """

    by_tendon: Floats
    rest: Floats
    slack: Floats
    lengths: Floats
    place: Floats
    turn: Floats

    def taut(self, servos: Floats) -> Floats:
        """Pulls v (n, 9) of tendons that are taut [mm]."""
        soft = SOFT * np.logaddexp(0.0, (servos - self.slack) / SOFT)
        return soft - SOFT * np.logaddexp(0.0, -self.slack / SOFT)

    def bends(self, servos: Floats) -> Floats:
        """Bending angles q (n, 6) [rad]."""
        return self.rest + self.taut(servos) @ self.by_tendon.T

    def tip(self, servos: Floats) -> Floats:
        """Tip (n, 3) in the robot's frame [m]."""
        return tip_of_bends(self.bends(servos), *self.lengths)

    def to_base(self, tip: Floats) -> Floats:
        """A tip (n, 3) of the motion capture in the robot's frame [m]."""
        return np.asarray((tip - self.place) @ Rotation.from_rotvec(self.turn).as_matrix())

    def to_vector(self) -> Floats:
        """All parameters."""
        parts = (self.by_tendon, self.rest, self.slack, self.lengths, self.place, self.turn)
        return np.concatenate([part.ravel() for part in parts])


SIZES = np.cumsum([6 * TENDONS, 6, TENDONS, 2, 3])


def from_vector(vector: Floats) -> Robot:
    """The robot of `Robot.to_vector`."""
    first, *others = np.split(vector, SIZES)
    return Robot(first.reshape(2 * SEGMENTS, TENDONS), *others)


def by_geometry() -> Robot:
    """The robot as its drawing says: equal segments, tendons 120 degrees apart on one circle.

    A tendon bends the segment at which it ends and those before alike.
    """
    ends = np.arange(TENDONS) // 3
    pull = -np.stack([np.cos(ANGLES), np.sin(ANGLES)]) / 15.0
    by_tendon = np.concatenate([pull * (ends >= segment) for segment in range(SEGMENTS)])
    slack, lengths = np.full(TENDONS, -3.0), np.array([0.06, 0.008])
    return Robot(by_tendon, np.zeros(6), slack, lengths, np.array([0.0, 0.008, 0.0]), np.zeros(3))


PRIOR = from_vector(
    np.concatenate(
        [
            np.full(6 * TENDONS, 0.02),
            np.full(6, 0.03),
            np.full(TENDONS, 0.3),
            np.full(2 + 3, 2e-3),
            np.full(3, 0.02),
        ]
    )
).to_vector()
"""Standard deviations of the parameters about the geometry, chosen on the record's second third."""


def fit(record: Record, evaluations: int = 40) -> Robot:
    """The most probable robot for a record: least squares with the geometry as the prior."""
    mean = by_geometry().to_vector()

    def residuals(vector: Floats) -> Floats:
        robot = from_vector(vector)
        error = (robot.to_base(record.tip) - robot.tip(record.servos)) / MODEL_ERROR
        return np.concatenate([error.ravel(), (vector - mean) / PRIOR])

    found = least_squares(residuals, mean, x_scale=PRIOR, max_nfev=evaluations)
    return from_vector(np.asarray(found.x))


def tip_of_bends(bends: Floats, length: float, tip_length: float) -> Floats:
    """Tips (n, 3) of states (n, 6), as kinematics "segments" but for many at once [m]."""
    turned = np.broadcast_to(np.eye(3), (len(bends), 3, 3))
    position = np.zeros((len(bends), 3))
    for bend in np.split(bends, SEGMENTS, axis=1):
        half = np.linalg.norm(bend, axis=1, keepdims=True) / 2
        # sin(x)/x and (1 - cos x)/x^2, smooth where the segment is straight.
        aside = np.sinc(half / np.pi) ** 2 / 2
        arc = np.hstack([bend * aside, np.sinc(2 * half / np.pi)])
        position = position + length * np.einsum("nij,nj->ni", turned, arc)
        axis = np.stack([-bend[:, 1], bend[:, 0], np.zeros(len(bend))], axis=1)
        turned = turned @ Rotation.from_rotvec(axis).as_matrix()
    return np.asarray(position + tip_length * turned[:, :, 2])


def tip_jacobian(bends: Floats, length: float, tip_length: float) -> Floats:
    """dp/dq (3, 6) in a state (6,), by central differences [m/rad]."""
    steps = 1e-6 * np.eye(2 * SEGMENTS)
    tips = tip_of_bends(np.concatenate([bends + steps, bends - steps]), length, tip_length)
    ahead, behind = np.split(tips, 2)
    return np.asarray((ahead - behind).T / 2e-6)
