"""The loop of Fig. 6: reference in, command out, contact offsets estimated from the images."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, partial, wraps
from itertools import compress
from threading import RLock
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope._core import MOST_SENSORS
from tautscope.config import Config, check_config, from_document, to_document
from tautscope.dof import Dof, display_text
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.actuators import Actuators
from tautscope.loop.construction import build_loop
from tautscope.loop.kinematics import Floats, Predict, build_kinematics
from tautscope.loop.measurement import Measurement, Points, Pose, Reading, Sensors, Tip
from tautscope.loop.rig import Frame
from tautscope.loop.safety import Reaction, Supervision, advice, checksum, disabled_monitors
from tautscope.loop.signal_checks import (
    check_covariance,
    check_features,
    check_signal,
    check_time,
    check_values,
)
from tautscope.loop.state_prediction import StatePrediction

if TYPE_CHECKING:
    from tautscope import _core
    from tautscope.loop.vision import Detection, MarkerDetector

Method = TypeVar("Method", bound=Callable[..., Any])
Result = TypeVar("Result")
Triggers = tuple[str | None, str | None]
LIMITED = "limited by actuators.limits"
"""After the name of a degree of freedom in `Report.warnings`."""
LOGGED_TICKS = 100
"""After so many ticks each the log says, once, why nothing is compensated or ticks are late."""
OTHER_INTERVAL = math.log(1.4)
"""Logarithm of the ratio from which on ticks are not at `control.period`; jitter averages out."""
LASTING = 10
"""After so many times `LOGGED_TICKS` with a warning the log says it, once."""
_LOG = logging.getLogger(__name__)


class Status(StrEnum):
    """Result of an image update."""

    OK = "ok"
    """Every DOF was measured."""
    HELD = "held"
    """A DOF was not observable and was held at its prediction."""
    PARTIAL = "partial"
    """Only one marker was found; the DOFs it does not determine were held."""
    NO_MARKERS = "no_markers"
    """Neither marker was found."""
    STALE = "stale"
    """The frame was captured before the start of the command history."""
    DUPLICATE = "duplicate"
    """The frame was captured no later than one already used."""
    REFUSED = "refused"
    """A monitor rejected the frame, and no estimate was updated; `Report.warnings` names it."""


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """Result of an update by an image or another measurement; NaN is not known.

    Every (n,) array has an entry per degree of freedom [m or rad]: for the article's instrument
    insertion, rotation, bending [m, rad, rad].

    Attributes:
        detection: What the marker detector found, if it was used.
        captured_at: When the frame was captured [s].
        status: Result of the update.
        state_estimate: q_hat (n,). Profile ``paper``: Eq. (16), the prediction where a DOF is not
            observable. Profile ``best``: the most probable state, decision 0030.
        predicted_state: q (n,) at the capture time.
        predicted_features: h (4,) [px], Eq. (9), of the state the estimation started from: q, or
            with one band alone or profile ``best`` the state prediction of `predict_state`. Of
            another measurement the values (m,) expected, as all of the next two.
        innovation: Measured minus predicted features (4,) [px]; NaN for a band not found.
        observable: (n,) which DOFs the image determined.
        deviation: (n,) standard deviation per px of marker noise [m/px, rad/px]; NaN without
            bands.
        state_deviation: (n,) standard deviation of `state_estimate` from the detection's
            covariance, or for 1 px of noise without one; with profile ``paper`` NaN for a DOF
            that was held.
        triggers: Per DOF why (delta_minus, delta_plus) were updated: "contact", Eq. (4),
            "violation", Eq. (5), or None.
        delta_minus: (n,) contact offsets after this frame, input minus output.
        delta_plus: (n,) contact offsets after this frame, input minus output.
        reaction: The reaction in force after this frame.
        warnings: The flags in force, by the names of `tautscope.loop.safety.DETECTORS`, and a line
            for every monitor that ``safety.off`` disables, and for every degree of freedom that
            ``actuators.limits`` limited in the last tick.
    """

    detection: Detection | None
    captured_at: float
    status: Status
    state_estimate: NDArray[np.float64]
    predicted_state: NDArray[np.float64]
    predicted_features: NDArray[np.float64]
    innovation: NDArray[np.float64]
    observable: NDArray[np.bool_]
    deviation: NDArray[np.float64]
    state_deviation: NDArray[np.float64]
    triggers: tuple[Triggers, ...]
    delta_minus: NDArray[np.float64]
    delta_plus: NDArray[np.float64]
    reaction: Reaction
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        warnings = f", warnings {', '.join(self.warnings)}" if self.warnings else ""
        tip = ", ".join(f"{value:.3g}" for value in self.state_estimate)
        slack = ", ".join(f"{value:.3g}" for value in self.delta_plus - self.delta_minus)
        return (
            f"<Report of {self.captured_at:.3f} s: {self.status}, "
            f"tip at {tip}, slack {slack} [m or rad]{warnings}>"
        )


@dataclass(frozen=True, slots=True, eq=False)
class HysteresisEstimate:
    """The estimated hysteresis in profile ``best``; (n,) arrays are [m or rad].

    The last four are of the article's instrument, None of another robot.

    Attributes:
        half_width: (n,) half widths of the slack of each DOF that moves alone.
        width_std: (n,) standard deviations of the half widths.
        centre: (n,) centres of the contact offsets, input minus output.
        gain: (n,) travel of the tip over that of the command in contact.
        gain_std: (n,) its standard deviations.
        shared: Share of the friction that insertion and rotation have in common, 0 to 1.
        unevenness: Of the section's curvature: half of the difference of its ends, over the mean.
        image_shift: (2,) shift of the image against the configured camera [px], from a wrong pose
            or principal point; `camera.fx` px are about a radian.
        image_shift_std: (2,) its standard deviations [px].
    """

    half_width: NDArray[np.float64]
    width_std: NDArray[np.float64]
    centre: NDArray[np.float64]
    gain: NDArray[np.float64]
    gain_std: NDArray[np.float64]
    shared: float | None = None
    unevenness: float | None = None
    image_shift: NDArray[np.float64] | None = None
    image_shift_std: NDArray[np.float64] | None = None


def _exclusive(call: Method) -> Method:
    """A method that waits for those of other threads: measurements call models in Python."""

    @wraps(call)
    def wait(loop: HysteresisReduction, /, *arguments: Any, **keys: Any) -> Any:
        with loop._lock:
            if loop._is_calling:
                where = "a call in predict, jacobian, tip, points or actuators.map"
                raise SignalError(call.__name__, where, "a call outside of them")
            return call(loop, *arguments, **keys)

    return cast(Method, wait)


def _captured_at(frame: Frame) -> float:
    if not isinstance(frame, Frame):
        raise SignalError("frame", type(frame).__name__, "a tautscope.Frame")
    return check_time("captured_at", frame.captured_at)


class HysteresisReduction:
    """Image-based hysteresis reduction, Fig. 6: `step` at the control rate, `on_frame` per image.

    Of a robot with [[dof]] every array has n entries in its order, and in place of images there are
    `on_tip`, `on_pose`, `on_points` and `on_measurement`. What is late, repeated or out of order is
    treated as an image; of several sensors each counts by itself. Any thread may call any method.

    Args:
        config: All settings of the loop.
        compensate: If false, every gain is 1 (Table 1, "uncompensated"); the estimators still run.

    Attributes:
        updates: Number of image updates so far.
        on_event: Called at every `engage`, `acknowledge`, `set_compensation`, `raise_flag` and
            `prepare_detection` with the name of the call (and the share, the flag or the sequence
            of the frame): a replay needs these beside references and images.
    """

    def __init__(self, config: Config, compensate: bool = True) -> None:
        self._config = check_config(config)
        self._lock, self._is_calling = RLock(), False
        self._ticks = self.updates = 0
        self.on_event: Callable[[str], None] | None = None
        self._disabled = disabled_monitors(config)
        self._dofs = len(config.dofs)
        self._loop = build_loop(config, compensate)
        if config.dof:
            self._sensors = Sensors(config, build_kinematics(config))
        is_limited = config.actuators is not None and bool(config.actuators.limits)
        self._actuators = Actuators(config) if is_limited else None
        self._limited: tuple[str, ...] = ()
        self._limited_before: set[str] = set()
        self._least_logged = Reaction.FADE if compensate else Reaction.HOLD_MOTION
        self._logged: set[str] = set()
        self._lasting: dict[str, int] = {}
        self._time = self._logged_at = math.nan
        self._longest = 0.0

    def __repr__(self) -> str:
        slack = display_text(self.delta_plus - self.delta_minus, self._config.dofs)
        return (
            f"<HysteresisReduction: profile {self._config.profile}, {self.updates} updates, "
            f"reaction {self.supervision.reaction}, slack {slack}>"
        )

    @_exclusive
    def step(
        self, reference: ArrayLike, time: float | None = None, made_at: float | None = None
    ) -> NDArray[np.float64]:
        """One control tick: the command for a reference, Eqs. (2)-(3).

        Args:
            reference: u (n,) [m or rad].
            time: The rig's clock [s]; if not given, ticks of `control.period` from 0 on.
            made_at: When the reference was made [s, the same clock], if known. A reference older
                than ``safety.reference_age`` causes no motion.

        Returns:
            c (n,) [m or rad], as far as ``actuators.limits`` allow; what they do not allow of the
            reference's motion is discarded. The first reference is passed through. While motion is
            held, the last command.

        Raises:
            SignalError: The reference is not n finite numbers, or a time is not finite; the
                loop is unchanged. Or ``actuators.map`` returned something else than m numbers; the
                command rests.
        """
        values = check_signal("reference", reference, (self._dofs,))
        if time is None:
            time = self._ticks * self._config.control.period
        time = check_time("time", time)
        made_at = None if made_at is None else check_time("made_at", made_at)
        self._ticks += 1
        self._longest = max(self._longest, time - self._time)
        self._time = time
        self._limited = ()
        if self._ticks % LOGGED_TICKS == 0:  # no report tells of measurements that do not come
            now = self.supervision
            self._log_reaction(time, now)
            self._log_warnings(time, now)
            self._log_interval(time)
        limit = None if self._actuators is None else self._within_limits
        return self._calling(self._loop.step, values, time, made_at, limit)

    def on_frame(self, frame: Frame) -> Report:
        """Image update: find the markers, estimate the state and the offsets, Eqs. (4)-(16).

        Raises:
            FrameError: The image is not what the configured camera gives.
            SignalError: It is no `Frame`, or its capture time not finite.
        """
        return self.on_detection(frame, self._detection(frame)())

    def prepare_detection(self, frame: Frame) -> Callable[[], Detection]:
        """First part of `on_frame`: a function that finds the markers, for any thread to call.

        The function does not use the loop, so `step` may be called meanwhile. Pass its result to
        `on_detection` before preparing the next frame. The image must not change until then: pass a
        copy of a buffer that the camera reuses.

        Raises:
            SignalError: As `on_frame`.
        """
        detect = self._detection(frame)
        self._notify(f"prepare_detection {frame.sequence}")
        return detect

    def on_detection(self, frame: Frame, detection: Detection) -> Report:
        """Second part of `on_frame`: the update with the result of `prepare_detection`."""
        captured_at = _captured_at(frame)
        found = any(detection.found)
        features, covariance = (detection.features, detection.covariance) if found else (None, None)
        return self._update(features, covariance, captured_at, detection, checksum(frame.image))

    def on_features(self, features: ArrayLike | None, captured_at: float) -> Report:
        """Image update with the features of your own marker detector.

        Args:
            features: u and v of band A, u and v of band B (4,) [px]; NaN for both of a band that
                was not found, None if neither was.
            captured_at: When the frame was captured [s, the clock of `step`].

        Raises:
            SignalError: The features are not four numbers, finite for each band but for one that
                was not found, or the time is not finite.
        """
        values = None if features is None else check_features(features)
        return self._update(values, None, check_time("captured_at", captured_at))

    def on_tip(
        self,
        values: ArrayLike,
        captured_at: float,
        covariance: ArrayLike | None = None,
        *,
        sensor: int = 0,
    ) -> Report:
        """Update with the tip measured degree by degree.

        Args:
            values: (n,) [m or rad]; NaN for a degree of freedom that was not measured.
            captured_at: When it was measured [s, the clock of `step`].
            covariance: (n, n); without it `measurement.tip_deviation`.
            sensor: Which of 4 sensors, each with its own rate and delay.

        Raises:
            SignalError: A shape is wrong, a number infinite, all values NaN, or the covariance not
                positive definite; the configuration has no [[dof]].
        """
        return self.on_sample(Tip(values, captured_at, covariance, sensor))

    def on_pose(
        self,
        position: ArrayLike,
        captured_at: float,
        orientation: ArrayLike | None = None,
        covariance: ArrayLike | None = None,
        *,
        sensor: int = 0,
    ) -> Report:
        """Update with a pose of the tip: an EM tracker, a board of markers, motion capture.

        Args:
            position: (3,) [m] in the frame of the kinematics; NaN for what was not measured.
            captured_at: When it was measured [s, the clock of `step`].
            orientation: Rotation matrix (3, 3), or quaternion (4,) x, y, z, w.
            covariance: (3, 3), or (6, 6) with an orientation: position [m], then rotation about the
                sensor's axes [rad]; without it `measurement.position_deviation` and
                `measurement.orientation_deviation`.
            sensor: Which of 4 sensors, each with its own rate and delay.

        Raises:
            SignalError: As `on_tip`; the orientation is no rotation; no kinematics is configured.
        """
        return self.on_sample(Pose(position, captured_at, orientation, covariance, sensor))

    def on_points(
        self,
        pixels: ArrayLike,
        captured_at: float,
        covariance: ArrayLike | None = None,
        *,
        sensor: int = 0,
    ) -> Report:
        """Update with the pixels of the points of the kinematics.

        Args:
            pixels: (k, 2) [px], k at most 8; NaN for a point that was not found.
            captured_at: When the image was captured [s, the clock of `step`].
            covariance: (2 k, 2 k) [px^2]; without it `measurement.point_deviation`.
            sensor: Which of 4 sensors, each with its own rate and delay.

        Raises:
            SignalError: As `on_tip`; the kinematics has no method ``points``.
        """
        return self.on_sample(Points(pixels, captured_at, covariance, sensor))

    def on_measurement(
        self,
        values: ArrayLike,
        captured_at: float,
        covariance: ArrayLike,
        predict: Predict,
        *,
        jacobian: Predict | None = None,
        sensor: int = 0,
    ) -> Report:
        """Update with anything that depends on the state.

        Args:
            values: z (m,), m at most 16; NaN for what was not measured.
            captured_at: When it was measured [s, the clock of `step`].
            covariance: (m, m).
            predict: q (n,) to the values z (m,) that would be measured.
            jacobian: q (n,) to dz/dq (m, n); without it by differences.
            sensor: Which of 4 sensors, each with its own rate and delay.

        Raises:
            SignalError: As `on_tip`; `predict` or `jacobian` is no function, or a result of it has
                another shape.
        """
        sensors = self._axes_sensors("on_measurement")
        derived = predict if jacobian is None else jacobian
        for name, given in (("predict", predict), ("jacobian", derived)):
            if not callable(given):
                raise SignalError(name, given, "a function of q (n,)")
        found = check_values(values)
        known = check_covariance("covariance", covariance, len(found))
        reading = sensors.own(found, known, predict, jacobian)
        return self._update_by(reading, captured_at, sensor)

    def on_sample(self, measurement: Measurement) -> Report:
        """Update with a measurement of a rig: `on_tip`, `on_pose` or `on_points`."""
        kind = type(measurement).__name__
        if not isinstance(measurement, Measurement):
            raise SignalError("measurement", kind, "a Tip, Pose or Points")
        call = f"on_{kind.lower()}"
        reading = self._axes_sensors(call).reading(measurement)
        return self._update_by(reading, measurement.captured_at, measurement.sensor)

    @property
    @_exclusive
    def supervision(self) -> Supervision:
        """Reaction and flags in force now."""
        reaction, flags, latched, lead = self._loop.supervision
        return Supervision(Reaction(reaction), tuple(flags), tuple(latched), lead)

    @_exclusive
    def engage(self) -> None:
        """Re-engage: resume held motion, without a jump of the command.

        A cause that persists stops the motion again at once; a flag that needs a restart remains.
        """
        self._loop.engage()
        self._logged.difference_update(Reaction)  # the log tells of the next hold, too
        self._notify("engage")

    @_exclusive
    def acknowledge(self) -> None:
        """Acknowledge the warnings: empty `Supervision.latched`; nothing else changes.

        Compensation that was faded out returns with motion, once the cause has cleared.
        """
        self._loop.acknowledge()
        self._notify("acknowledge")

    @_exclusive
    def set_compensation(self, share: float) -> None:
        """Use a share of the compensation: all with 1, none with 0.

        Bumpless: the command moves only with the reference. The supervisor uses a share of it.

        Raises:
            ConfigError: The share is not from 0 to 1; the loop is unchanged.
        """
        try:
            value = float(share)
        except (TypeError, ValueError, OverflowError):
            raise ConfigError("compensation", share, "a share from 0 to 1") from None
        self._loop.set_compensation(value)
        self._notify(f"set_compensation {value!r}")

    @_exclusive
    def raise_flag(self, name: str) -> None:
        """Raise a flag that only the rig can detect: ``drive_fault``, ``following_error``.

        Raises:
            ConfigError: The name is none of `tautscope.loop.safety.DETECTORS`.
        """
        self._loop.raise_flag(name)
        self._notify(f"raise_flag {name}")

    @_exclusive
    def predict_state(self, captured_at: float) -> StatePrediction | None:
        """State at a capture time: the model's, corrected by the last images, with its std.

        `MarkerDetector.detect` searches around it. None if the history does not reach that time.
        """
        prediction = self._band_loop("predict_state").predict_state(captured_at)
        return None if prediction is None else StatePrediction(*prediction)

    @_exclusive
    def predicted_features(self, captured_at: float) -> NDArray[np.float64] | None:
        """h(q) (4,) [px] at a capture time, Eq. (9), for a marker detector of your own.

        None if the history does not reach that time, or a marker is behind the camera.
        """
        return self._band_loop("predicted_features").predicted_features(captured_at)

    @property
    @_exclusive
    def reference(self) -> NDArray[np.float64]:
        """The reference that the law follows (n,) [m or rad]; NaN before the first.

        It differs from the last one given by motion that was discarded, or that is too fast: beyond
        the range of a command or of a motor, after a late tick, while motion was held.
        """
        return self._loop.reference

    @property
    @_exclusive
    def predicted_state(self) -> NDArray[np.float64]:
        """The model's tip state q (n,) [m or rad] now; NaN before the first tick."""
        return self._loop.predicted_state

    @property
    @_exclusive
    def delta_minus(self) -> NDArray[np.float64]:
        """The estimated negative contact offsets (n,) [m or rad], input minus output."""
        return self._loop.delta_minus

    @property
    @_exclusive
    def delta_plus(self) -> NDArray[np.float64]:
        """The estimated positive contact offsets (n,) [m or rad], input minus output."""
        return self._loop.delta_plus

    @property
    @_exclusive
    def hysteresis(self) -> HysteresisEstimate | None:
        """The estimated hysteresis; None in profile ``paper``."""
        if self._config.profile == "paper":
            return None
        return HysteresisEstimate(*self._loop.hysteresis)

    @_exclusive
    def estimated_config(self) -> Config:
        """The configuration with the contact offsets estimated so far as initial ones.

        A loop made of it, the next day or for the next episode, begins near this slack: within 8 %
        from a third of `width_limit` on, and never below a sixth of it.
        `tautscope.config.dump_config` writes it.
        """
        document = to_document(self._config)
        sections = document["dof"] or [document[dof.label] for dof in Dof]
        offsets = zip(self.delta_minus.tolist(), self.delta_plus.tolist(), strict=True)
        for section, (minus, plus) in zip(sections, offsets, strict=True):
            section.update(delta_minus=minus, delta_plus=plus)
        return from_document(document)

    def __reduce__(self) -> NoReturn:
        raise TypeError("A loop has no copy; make a new one of its estimated_config()")

    @cached_property
    def _detector(self) -> MarkerDetector:
        # Users with their own detector do not need this one.
        from tautscope.loop.vision import MarkerDetector  # noqa: PLC0415

        return MarkerDetector(self._config)

    def _detection(self, frame: Frame) -> Callable[[], Detection]:
        self._band_loop("on_frame")
        prediction = self.predict_state(_captured_at(frame))
        return partial(self._detector.detect, frame.image, None, prediction)

    def _band_loop(self, call: str) -> _core.Reduction:
        if self._config.dof:
            allowed = "a configuration without [[dof]]; on_tip, on_pose, on_points with it"
            raise SignalError(call, "[[dof]]", allowed)
        return self._loop

    def _axes_sensors(self, call: str) -> Sensors:
        if not self._config.dof:
            raise SignalError(call, "no [[dof]]", "a configuration with [[dof]]; tautscope.axes")
        return self._sensors

    @_exclusive
    def _update_by(self, reading: Reading, captured_at: float, sensor: int) -> Report:
        captured_at = check_time("captured_at", captured_at)
        if not isinstance(sensor, int | np.integer) or sensor not in range(MOST_SENSORS):
            raise SignalError("sensor", sensor, f"0 to {MOST_SENSORS - 1}")
        delays = self._config.measurement.delays
        captured_at -= delays[sensor] if sensor < len(delays) else 0.0
        known = reading.values, reading.covariance
        given = *known, captured_at, reading.model, reading.point, sensor
        result = self._calling(self._loop.on_reading, *given)
        self._log_slow(reading, captured_at)
        return self._report(result, captured_at)

    def _calling(self, call: Callable[..., Result], *arguments: Any) -> Result:
        """Result of a call that calls functions of the user's, which cannot use the loop."""
        try:
            self._is_calling = True
            return call(*arguments)
        finally:
            self._is_calling = False

    def _within_limits(self, last: Floats, command: Floats) -> Floats:
        assert self._actuators is not None
        excess = self._actuators.excess(command)
        if not excess or not np.isfinite(last).all():  # the rig refuses such a first command
            return command
        reached = self._actuators.limited(last, command)
        held = compress(self._config.dofs, reached != command)
        self._limited = tuple(dof.label for dof in held)
        if not self._limited_before.issuperset(self._limited):
            self._limited_before.update(self._limited)
            what = " and ".join(self._limited)
            _LOG.warning("%s: %s; the command needs %s", what, LIMITED, excess)
        return reached

    def _log_reaction(self, time: float, now: Supervision) -> None:
        if now.reaction.rank >= self._least_logged.rank:
            self._log_once(now.reaction, "at %.3f s: %s", time, now.effect)

    def _log_warnings(self, time: float, now: Supervision) -> None:
        # Other reactions have a line of their own.
        is_warning = now.reaction is Reaction.WARN and self._least_logged is Reaction.FADE
        flags = now.flags if is_warning else ()
        self._lasting = {flag: self._lasting.get(flag, 0) + 1 for flag in flags}
        for flag, count in self._lasting.items():
            if count == LASTING:
                ticks = LASTING * LOGGED_TICKS
                what = "at %.3f s: %s for %d ticks: %s"
                self._log_once(flag, what, time, flag, ticks, advice(flag))

    def _log_interval(self, time: float) -> None:
        # Without the longest one: a pause is no interval.
        interval = (time - self._logged_at - self._longest) / (LOGGED_TICKS - 1)
        self._logged_at, self._longest = time, 0.0
        period = self._config.control.period
        if interval > 0 and abs(math.log(interval / period)) > OTHER_INTERVAL:
            what = "control ticks come every %.4g s: set control.period to it. With %g s limits "
            what += "of speed are wrong by the ratio, and later ticks may move nothing"
            self._log_once("interval", what, interval, period)

    def _log_slow(self, reading: Reading, time: float) -> None:
        # The flags of late ticks blame other programs. These make some calls longer, not the least.
        took = len(reading.times) * min(reading.times, default=0.0)
        stall, name = self._config.safety.stall, reading.name
        if took > stall / 2:
            what = "at %.3f s: an update takes %.2g s, with %d calls of %s, and step waits for it. "
            what += "More than half of safety.stall = %g s may hold motion: make %s faster, or "
            what += "give on_measurement a jacobian"
            calls = reading.calls * len(reading.times)
            self._log_once(name, what, time, took, calls, name, stall, name)

    def _log_once(self, key: str, text: str, *values: object) -> None:
        if key not in self._logged:
            self._logged.add(key)
            _LOG.warning(text, *values)

    def _notify(self, what: str) -> None:
        if self.on_event is not None:
            self.on_event(what)

    @_exclusive
    def _update(
        self,
        features: Floats | None,
        covariance: Floats | None,
        captured_at: float,
        detection: Detection | None = None,
        image_checksum: int | None = None,
    ) -> Report:
        loop = self._band_loop("on_features")
        result = loop.on_features(features, captured_at, covariance, image_checksum)
        return self._report(result, captured_at, detection)

    def _report(
        self, result: _core._Update, captured_at: float, detection: Detection | None = None
    ) -> Report:
        self.updates += 1
        now = self.supervision
        self._log_reaction(captured_at, now)
        limited = (f"{name} {LIMITED}" for name in self._limited)
        warnings = (*self._disabled, *now.flags, *limited)
        return Report(
            detection, captured_at, Status(result[0]), *result[1:], now.reaction, warnings
        )
