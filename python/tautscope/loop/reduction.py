"""The loop of Fig. 6: reference in, command out, contact offsets estimated from the images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.dof import display_text
from tautscope.loop.construction import build_loop
from tautscope.loop.rig import Frame
from tautscope.loop.safety import Reaction, Supervision, checksum, disabled_monitors
from tautscope.loop.signal_checks import check_features, check_signal, check_time
from tautscope.loop.state_prediction import StatePrediction

if TYPE_CHECKING:
    from tautscope.loop.vision import Detection, MarkerDetector

Triggers = tuple[str | None, str | None]


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


@dataclass(frozen=True, slots=True)
class Report:
    """Result of an image update. Every (3,) array is [m, rad, rad]; NaN is not known.

    Attributes:
        detection: What the marker detector found, if it was used.
        captured_at: When the frame was captured [s].
        status: Result of the update.
        state_estimate: q_hat (3,). Profile ``paper``: Eq. (16), the prediction where a DOF is not
            observable. Profile ``best``: the most probable state, decision 0030.
        predicted_state: q (3,) at the capture time.
        predicted_features: h (4,) [px], Eq. (9), of the state the estimation started from: q, or
            with one band alone or profile ``best`` the state prediction of `predict_state`.
        innovation: Measured minus predicted features (4,) [px]; NaN for a band not found.
        observable: (3,) which DOFs the image determined.
        deviation: (3,) standard deviation per px of marker noise [m/px, rad/px].
        state_deviation: (3,) standard deviation of `state_estimate` from the detection's
            covariance, or for 1 px of noise without one; with profile ``paper`` NaN for a DOF
            that was held.
        triggers: Per DOF why (delta_minus, delta_plus) were updated: "contact", Eq. (4),
            "violation", Eq. (5), or None.
        delta_minus: (3,) contact offsets after this frame, input minus output.
        delta_plus: (3,) contact offsets after this frame, input minus output.
        reaction: The reaction in force after this frame.
        warnings: The flags in force, by the names of `tautscope.loop.safety.DETECTORS`, and a line
            for every monitor that ``safety.off`` disables.
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
    triggers: tuple[Triggers, Triggers, Triggers]
    delta_minus: NDArray[np.float64]
    delta_plus: NDArray[np.float64]
    reaction: Reaction
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        warnings = f", warnings {', '.join(self.warnings)}" if self.warnings else ""
        return (
            f"<Report of {self.captured_at:.3f} s: {self.status}, "
            f"tip at {display_text(self.state_estimate)}, "
            f"slack {display_text(self.delta_plus - self.delta_minus)}{warnings}>"
        )


@dataclass(frozen=True, slots=True, eq=False)
class HysteresisEstimate:
    """The estimated hysteresis in profile ``best``; (3,) arrays are [m, rad, rad].

    Attributes:
        half_width: (3,) half widths of the slack of each DOF that moves alone.
        width_std: (3,) standard deviations of the half widths.
        centre: (3,) centres of the contact offsets, input minus output.
        shared: Share of the friction that insertion and rotation have in common, 0 to 1.
        gain: (3,) travel of the tip over that of the command in contact.
        gain_std: (3,) its standard deviations.
        unevenness: Of the section's curvature: half of the difference of its ends, over the mean.
        image_shift: (2,) shift of the image against the configured camera [px], from a wrong pose
            or principal point; `camera.fx` px are about a radian.
        image_shift_std: (2,) its standard deviations [px].
    """

    half_width: NDArray[np.float64]
    width_std: NDArray[np.float64]
    centre: NDArray[np.float64]
    shared: float
    gain: NDArray[np.float64]
    gain_std: NDArray[np.float64]
    unevenness: float
    image_shift: NDArray[np.float64]
    image_shift_std: NDArray[np.float64]


class HysteresisReduction:
    """Image-based hysteresis reduction, Fig. 6: `step` at the control rate, `on_frame` per image.

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
        self._config = config
        self._ticks = self.updates = 0
        self.on_event: Callable[[str], None] | None = None
        self._disabled = disabled_monitors(config)
        self._loop = build_loop(config, compensate)

    def __repr__(self) -> str:
        return (
            f"<HysteresisReduction: profile {self._config.profile}, {self.updates} image updates, "
            f"reaction {self.supervision.reaction}, "
            f"slack {display_text(self.delta_plus - self.delta_minus)}>"
        )

    def step(
        self, reference: ArrayLike, time: float | None = None, made_at: float | None = None
    ) -> NDArray[np.float64]:
        """One control tick: the command for a reference, Eqs. (2)-(3).

        Args:
            reference: u (3,) [m, rad, rad].
            time: The rig's clock [s]; if not given, ticks of `control.period` from 0 on.
            made_at: When the reference was made [s, the same clock], if known. A reference older
                than ``safety.reference_age`` causes no motion.

        Returns:
            c (3,) [m, rad, rad]. The first reference is passed through. While motion is held, the
            last command.

        Raises:
            SignalError: The reference is not three finite numbers, or a time is not finite;
                the loop is unchanged.
        """
        values = check_signal("reference", reference, (3,))
        if time is None:
            time = self._ticks * self._config.control.period
        time = check_time("time", time)
        self._ticks += 1
        return self._loop.step(
            values, time, None if made_at is None else check_time("made_at", made_at)
        )

    def on_frame(self, frame: Frame) -> Report:
        """Image update: find the markers, estimate the state and the offsets, Eqs. (4)-(16).

        Raises:
            FrameError: The image is not what the configured camera gives.
            SignalError: The capture time is not finite.
        """
        return self.on_detection(frame, self._detection(frame)())

    def prepare_detection(self, frame: Frame) -> Callable[[], Detection]:
        """First part of `on_frame`: a function that finds the markers, for any thread to call.

        The function does not use the loop, so `step` may be called meanwhile. Pass its result to
        `on_detection` before preparing the next frame.

        Raises:
            SignalError: The capture time is not finite.
        """
        detect = self._detection(frame)
        self._notify(f"prepare_detection {frame.sequence}")
        return detect

    def on_detection(self, frame: Frame, detection: Detection) -> Report:
        """Second part of `on_frame`: the update with the result of `prepare_detection`."""
        captured_at = check_time("captured_at", frame.captured_at)
        found = any(detection.found)
        return self._update(
            detection.features if found else None,
            detection.covariance if found else None,
            captured_at,
            detection,
            checksum(frame.image),
        )

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

    @property
    def supervision(self) -> Supervision:
        """Reaction and flags in force now."""
        reaction, flags, latched, lead = self._loop.supervision
        return Supervision(Reaction(reaction), tuple(flags), tuple(latched), lead)

    def engage(self) -> None:
        """Re-engage: resume held motion, without a jump of the command.

        A cause that persists stops the motion again at once; a flag that needs a restart remains.
        """
        self._loop.engage()
        self._notify("engage")

    def acknowledge(self) -> None:
        """Acknowledge the warnings: empty `Supervision.latched`; nothing else changes.

        Compensation that was faded out returns with motion, once the cause has cleared.
        """
        self._loop.acknowledge()
        self._notify("acknowledge")

    def set_compensation(self, share: float) -> None:
        """Use a share of the compensation: all with 1, none with 0.

        Bumpless: the command moves only with the reference. The supervisor uses a share of it.

        Raises:
            ConfigError: The share is not from 0 to 1; the loop is unchanged.
        """
        self._loop.set_compensation(float(share))
        self._notify(f"set_compensation {float(share)!r}")

    def raise_flag(self, name: str) -> None:
        """Raise a flag that only the rig can detect: ``drive_fault``, ``following_error``.

        Raises:
            ConfigError: The name is none of `tautscope.loop.safety.DETECTORS`.
        """
        self._loop.raise_flag(name)
        self._notify(f"raise_flag {name}")

    def predict_state(self, captured_at: float) -> StatePrediction | None:
        """State at a capture time: the model's, corrected by the last images, with its std.

        `MarkerDetector.detect` searches around it. None if the history does not reach that time.
        """
        prediction = self._loop.predict_state(captured_at)
        return None if prediction is None else StatePrediction(*prediction)

    def predicted_features(self, captured_at: float) -> NDArray[np.float64] | None:
        """h(q) (4,) [px] at a capture time, Eq. (9), for a marker detector of your own.

        None if the history does not reach that time, or a marker is behind the camera.
        """
        return self._loop.predicted_features(captured_at)

    @property
    def predicted_state(self) -> NDArray[np.float64]:
        """The model's tip state q (3,) [m, rad, rad] now; NaN before the first tick."""
        return self._loop.predicted_state

    @property
    def delta_minus(self) -> NDArray[np.float64]:
        """The estimated negative contact offsets (3,) [m, rad, rad], input minus output."""
        return self._loop.delta_minus

    @property
    def delta_plus(self) -> NDArray[np.float64]:
        """The estimated positive contact offsets (3,) [m, rad, rad], input minus output."""
        return self._loop.delta_plus

    @property
    def hysteresis(self) -> HysteresisEstimate | None:
        """The estimated hysteresis; None in profile ``paper``."""
        found = self._loop.hysteresis
        return None if found is None else HysteresisEstimate(*found)

    @cached_property
    def _detector(self) -> MarkerDetector:
        # Users with their own detector do not need this one.
        from tautscope.loop.vision import MarkerDetector  # noqa: PLC0415

        return MarkerDetector(self._config)

    def _detection(self, frame: Frame) -> Callable[[], Detection]:
        prediction = self.predict_state(check_time("captured_at", frame.captured_at))
        return partial(self._detector.detect, frame.image, None, prediction)

    def _notify(self, what: str) -> None:
        if self.on_event is not None:
            self.on_event(what)

    def _update(
        self,
        features: NDArray[np.float64] | None,
        covariance: NDArray[np.float64] | None,
        captured_at: float,
        detection: Detection | None = None,
        image_checksum: int | None = None,
    ) -> Report:
        result = self._loop.on_features(features, captured_at, covariance, image_checksum)
        self.updates += 1
        now = self.supervision
        warnings = (*self._disabled, *now.flags)
        return Report(
            detection, captured_at, Status(result[0]), *result[1:], now.reaction, warnings
        )
