"""Inputs of the loop and what it answered in Python, for the controller in C++ to repeat.

Run it with ``uv run python examples/cpp/record.py FOLDER``. A recording is three files,
with rows of float64:

- ``NAME.toml``: the configuration with every key.
- ``NAME.ticks``: time, made_at, reference (3,), event; command (3,).
- ``NAME.images``: tick, captured_at, features (4,); status, reaction, flags, state estimate (3,),
  delta_minus (3,), delta_plus (3,); features found without a prediction (4,), checksum.

``axes_paper`` and ``axes_best`` are of a robot with [[dof]], whose measurements are in
``NAME.measurements``: tick, captured_at, kind, values (3,); status, reaction, flags, state estimate
(3,), innovation (3,), delta_minus (3,), delta_plus (3,), half widths (3,). Each kind is a sensor: 0
is the tip degree by degree, 1 that of `_own` by differences, 2 with its Jacobian.
``NAME-short.toml`` has only the keys that are not defaults.

``tip_paper`` and ``tip_best`` are of two degrees of freedom, measured as they are: the same files,
with (2,) in place of (3,), and in ``NAME.images`` the tip (2,) in place of features.

Except of the axes the reference rests in the second tick, in which nodes and controllers of ROS
begin to follow it.

``configs`` has each configuration that comes with the package, with every key.

``frames.pixels`` has the images themselves, ``frames.workspace`` the states (3,) that the detection
starts from without a prediction: starts, their standard deviations, postures. Units are m, rad, s,
px; NaN is not known.
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tautscope import Config, Frame, HysteresisReduction, Report, axes
from tautscope.config import RIGS, ControlConfig, Profile, dump_config, load_config
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import Status
from tautscope.loop.safety import DETECTORS, checksum
from tautscope.loop.vision import MarkerDetector, _workspace, workspace_starts

sys.path.insert(0, str(Path(__file__).parents[1]))

from own_rig import DrawnRig, short_experiment

DURATION = 60.0
PERIOD = 1e-3
TICKS_PER_IMAGE = 40
LATENCY = 80
"""From capture to arrival, in ticks."""

SEED = 20
NOISE = 0.3
"""Standard deviation of the features [px]."""

WIDTHS = np.array([10e-3, 1.8, 1.1])
CENTRES = np.array([25e-3, 0.0, 0.9])
AMPLITUDES = np.array([15e-3, 1.5, 0.6])
PERIODS = np.array([20.0, 23.0, 17.0])

EVENTS = {16.0: 1, 31.0: 1, 35.0: 2, 40.0: 3, 41.0: 1, 50.0: 4, 55.0: 5}
"""Times [s] of: 1 engage, 2 acknowledge, 3 drive fault, 4 half of the compensation, 5 all of it."""

OLD_REFERENCE = 14.0
"""Time [s] of a reference that is 1 s old, which stops the motion."""

JUMP = (30.0, np.array([8e-3, 0.0, 0.0]))
"""Time and size of a jump of the reference, which stops the motion."""

NOTHING = np.full(4, np.nan)


@dataclass
class Record:
    """A loop with what went in and came out."""

    config: Config
    loop: HysteresisReduction = field(init=False)
    ticks: list[NDArray[np.float64]] = field(default_factory=list)
    images: list[NDArray[np.float64]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.loop = HysteresisReduction(self.config)

    def step(
        self, time: float, reference: NDArray[np.float64], event: int = 0, age: float = np.nan
    ) -> NDArray[np.float64]:
        """One tick, after an event."""
        match event:
            case 1:
                self.loop.engage()
            case 2:
                self.loop.acknowledge()
            case 3:
                self.loop.raise_flag("drive_fault")
            case 4:
                self.loop.set_compensation(0.5)
            case 5:
                self.loop.set_compensation(1.0)
        made_at = time - age
        command = self.loop.step(reference, time, None if np.isnan(age) else made_at)
        self.ticks.append(np.array([time, made_at, *reference, event, *command]))
        return command

    def keep(
        self,
        report: Report,
        features: NDArray[np.float64],
        unlocated: NDArray[np.float64] = NOTHING,
        image_checksum: int = 0,
    ) -> None:
        """An image update after the last tick."""
        now = self.loop.supervision
        row = [
            len(self.ticks) - 1,
            report.captured_at,
            *features,
            list(Status).index(report.status),
            now.reaction.rank,
            sum(1 << DETECTORS.index(name) for name in now.flags),
            *report.state_estimate,
            *report.delta_minus,
            *report.delta_plus,
            *unlocated,
            image_checksum,
        ]
        self.images.append(np.array(row))

    def write(self, folder: Path, name: str) -> None:
        """The three files."""
        (folder / f"{name}.toml").write_text(dump_config(self.config), encoding="utf-8")
        for kind, rows in (("ticks", self.ticks), ("images", self.images)):
            np.array(rows).astype("<f8").tofile(folder / f"{name}.{kind}")


def record_features(profile: Profile) -> Record:
    """60 s at 1 kHz: centroids from three plays and an ideal camera, and every kind of event."""
    record = Record(Config(profile=profile, control=ControlConfig(period=PERIOD, history=1.0)))
    model = build_feature_model(record.config)
    random = np.random.default_rng(SEED)
    tip = CENTRES.copy()
    waiting: list[tuple[int, NDArray[np.float64]]] = []
    for tick in range(round(DURATION / PERIOD)):
        time = tick * PERIOD
        reference = CENTRES + AMPLITUDES * np.sin(2 * np.pi * max(time - PERIOD, 0) / PERIODS)
        if time >= JUMP[0]:
            reference += JUMP[1]
        age = 0.01 if 10 <= time < 15 else np.nan
        if tick == round(OLD_REFERENCE / PERIOD):
            age = 1.0
        command = record.step(time, reference, EVENTS.get(time, 0), age)
        tip = np.clip(tip, command - WIDTHS / 2, command + WIDTHS / 2)
        if tick % TICKS_PER_IMAGE == 0:
            seen = model.predict(tip)
            features = NOTHING if seen is None else seen[0] + random.normal(0, NOISE, 4)
            if 20 <= time < 21:
                features[2:] = np.nan
            waiting.append((tick, NOTHING if 22 <= time < 22.5 else features))
        if waiting and waiting[0][0] + LATENCY == tick:
            captured, features = waiting.pop(0)
            found = None if np.isnan(features).all() else features
            record.keep(record.loop.on_features(found, captured * PERIOD), features)
    return record


def record_frames(folder: Path) -> Record:
    """2 s with the images of `examples/own_rig.py`; their pixels go to a file."""
    record = Record(short_experiment())
    rig, detector = DrawnRig(record.config), MarkerDetector(record.config)
    starts, std = workspace_starts(record.config)
    states = np.vstack([starts, std, _workspace(record.config)])
    states.astype("<f8").tofile(folder / "frames.workspace")
    sample = rig.reset()
    with (folder / "frames.pixels").open("wb") as pixels:
        while sample.time < 2.0:
            moved = max(sample.time - rig.control_period, 0)
            reference = CENTRES + AMPLITUDES * np.sin(np.pi * moved / 2) / 2
            command = record.step(sample.time, reference)
            if (frame := sample.frame) is not None:
                pixels.write(frame.image.tobytes())
                report = record.loop.on_frame(Frame(frame.image, frame.captured_at, frame.sequence))
                assert report.detection is not None
                unlocated = detector.detect(frame.image).features
                record.keep(report, report.detection.features, unlocated, checksum(frame.image))
            sample = rig.step(command)
    return record


ROBOT = """\
[control]
history = 1
[[dof]]
name = "insertion"
unit = "m"
width_limit = 12e-3
range = [-0.1, 0.3]
friction = "shaft"
[[dof]]
name = "rotation"
width_limit = 2.6
speed = 6
friction = "shaft"
lever = 1.75e-3
[[dof]]
name = "bend"
width_limit = 1.5
expected_width = 0.8
gain_limit = 4
"""


def _own(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Without functions that C rounds differently."""
    return np.array([20 * q[0] + 0.5 * q[1], q[1] + 0.25 * q[2] * q[2], q[2] - 0.5 * q[1]])


def _jacobian(q: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([[20.0, 0.5, 0.0], [0.0, 1.0, 0.5 * q[2]], [0.0, -0.5, 1.0]])


def record_axes(folder: Path, profile: Profile) -> None:
    """60 s at 200 Hz of three plays and three sensors, and every kind of event."""
    name = f"axes_{profile}"
    short = folder / f"{name}-short.toml"
    short.write_text(f'profile = "{profile}"\n{ROBOT}', encoding="utf-8")
    record = Record(load_config(short))
    random = np.random.default_rng(SEED)
    rows = []
    tip, covariance = CENTRES.copy(), np.diag([1e-3, 1e-3, 1e-3])
    covariance[0, 1] = covariance[1, 0] = 2e-4
    late: list[tuple[float, NDArray[np.float64]]] = []
    for tick in range(12000):
        time = tick * 0.005
        reference = CENTRES + AMPLITUDES * np.sin(2 * np.pi * time / PERIODS)
        if time >= JUMP[0]:
            reference += JUMP[1]
        age = 1.0 if time == OLD_REFERENCE else np.nan
        command = record.step(time, reference, EVENTS.get(time, 0), age)
        tip = np.clip(tip, command - WIDTHS / 2, command + WIDTHS / 2)
        if tick % 5:
            continue
        late.append((time, tip.copy()))
        if len(late) < 3:
            continue
        at, seen = late.pop(0)
        kind = tick // 5 % 3
        noise = random.normal(0, 0.01, 3)
        if kind == 0:
            values = seen + noise * [12e-3, 2.6, 1.5]
            values[tick // 15 % 5 :][:1] = np.nan
            report = record.loop.on_tip(values, at)
        else:
            values = _own(seen) + noise
            report = record.loop.on_measurement(
                values, at, covariance, _own, jacobian=_jacobian if kind == 2 else None, sensor=kind
            )
        now, found = record.loop.supervision, record.loop.hysteresis
        half = found.half_width if found else (report.delta_plus - report.delta_minus) / 2
        flags = sum(1 << DETECTORS.index(name) for name in now.flags)
        row = [tick, at, kind, *values]
        row += [list(Status).index(report.status), now.reaction.rank, flags]
        row += [*report.state_estimate, *report.innovation, *report.delta_minus]
        rows.append([*row, *report.delta_plus, *half])
    record.write(folder, name)
    np.array(rows).astype("<f8").tofile(folder / f"{name}.measurements")


SLACK = np.array([0.6, 8e-3])
"""Of the two plays of `record_tip` [rad, m]."""


def record_tip(profile: Profile) -> Record:
    """40 s at 200 Hz of two plays, whose tip is measured 25 times a second, 50 ms late."""
    robot = axes(2, width_limit=[1.2, 12e-3], unit=["rad", "m"], names=["bend", "slide"])
    record = Record(robot.replace(profile=profile))
    random = np.random.default_rng(SEED)
    tip, late = np.zeros(2), []
    for tick in range(8000):
        time, moved = tick * 0.005, max(tick - 1, 0) * 0.005
        reference = [1.0, 10e-3] * np.sin(2 * np.pi * moved / np.array([4.0, 5.0]))
        command = record.step(time, reference, {4000: 4, 4400: 5}.get(tick, 0))
        tip = np.clip(tip, command - SLACK / 2, command + SLACK / 2)
        late.append((time, tip + random.normal(0, 1e-3, 2) * [1.2, 12e-3]))
        if tick >= 10 and tick % 8 == 0:
            at, values = late[tick - 10]
            values[tick // 8 % 7 :][:1] = np.nan
            record.keep(record.loop.on_tip(values, at), values)
    return record


def write_configs(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name in RIGS:
        (folder / f"{name}.toml").write_text(dump_config(load_config(name)), encoding="utf-8")


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for profile in ("paper", "best"):
        record_features(profile).write(folder, profile)
        record_axes(folder, profile)
        record_tip(profile).write(folder, f"tip_{profile}")
    record_frames(folder).write(folder, "frames")
    write_configs(folder / "configs")
    print(f"{folder}: 60 s of profiles paper and best and of robots with [[dof]], 2 s of images")


if __name__ == "__main__":
    main()
