"""The loop of Fig. 6: reference in, command out; images teach it the slack."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.loop.construction import build_loop
from tautscope.loop.rig import Frame
from tautscope.loop.safety import Reaction, Supervision, checksum, switched_off
from tautscope.loop.signal_checks import features_of, finite, seconds

if TYPE_CHECKING:
    from tautscope.loop.vision import Detection, MarkerDetector

Triggers = tuple[str | None, str | None]


class Status(StrEnum):
    """What became of a frame."""

    OK = "ok"
    """Every DOF was measured."""
    HELD = "held"
    """Some DOF could not be observed and was held at its prediction."""
    PARTIAL = "partial"
    """Only one marker was found; what it does not determine was held."""
    NO_MARKERS = "no_markers"
    """The markers were not found."""
    STALE = "stale"
    """Captured at a time the command history does not reach."""
    DUPLICATE = "duplicate"
    """Captured no later than a frame already used."""
    REFUSED = "refused"
    """A guard did not believe it: it taught nothing. `Report.warnings` has which."""


@dataclass(frozen=True, slots=True, eq=False)
class Expectation:
    """Where the instrument is believed to be when a frame was captured.

    Attributes:
        state: (3,) [m, rad, rad].
        deviation: (3,) standard deviations [m, rad, rad], each DOF by itself.
    """

    state: NDArray[np.float64]
    deviation: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Report:
    """What the loop made of a frame. Every (3,) array is [m, rad, rad]; NaN is not known.

    Attributes:
        detection: What the vision saw, if it was asked.
        captured_at: When the frame was taken [s].
        status: What became of it.
        state_estimate: q_hat (3,), with profile ``paper`` by Eq. (16), the prediction where a DOF
            is not observable; with ``best`` the most probable state, decision 0018.
        predicted_state: q (3,) at the capture time.
        predicted_features: h (4,) [px], Eq. (9), of the state the estimate started from: q; with
            one band alone, or profile ``best``, what the last images said.
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
        reaction: What is in force after this frame.
        warnings: Why, by the names of `tautscope.loop.safety.DETECTORS`; and a line for every guard
            that ``safety.off`` names.
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


class HysteresisReduction:
    """Image-based hysteresis reduction, Fig. 6: `step` at the control rate, `on_frame` per image.

    Args:
        config: Everything the loop depends on.
        compensate: Without it every gain is 1 (Table 1, "uncompensated"); the estimation goes on.

    Attributes:
        updates: Image updates up to now.
        on_event: Told of every call of `engage`, `acknowledge`, `raise_flag`, with the call's name
            (and the flag's): what a replay needs beside references and images.
    """

    def __init__(self, config: Config, compensate: bool = True) -> None:
        self._config = config
        self._ticks = self.updates = 0
        self.on_event: Callable[[str], None] | None = None
        self._off = switched_off(config)
        self._loop = build_loop(config, compensate)

    def step(
        self, reference: ArrayLike, time: float | None = None, made_at: float | None = None
    ) -> NDArray[np.float64]:
        """One control tick: the command for a reference, Eqs. (2)-(3).

        Args:
            reference: u (3,) [m, rad, rad].
            time: The rig's clock [s]; without it, ticks of `control.period` from 0 on.
            made_at: When the reference was made [s, the same clock], if that is known: one older
                than ``safety.reference_age`` moves nothing.

        Returns:
            c (3,) [m, rad, rad]. The first reference is passed through. While motion is held, the
            last command.

        Raises:
            SignalError: The reference is not three finite numbers, or the time is not finite;
                the loop is left as it was.
        """
        values = finite("reference", reference, (3,))
        at = self._ticks * self._config.control.period if time is None else seconds("time", time)
        self._ticks += 1
        return self._loop.step(values, at, None if made_at is None else seconds("made_at", made_at))

    def on_frame(self, frame: Frame) -> Report:
        """Image update: find the markers, estimate the state, learn the slack, Eqs. (4)-(16).

        Raises:
            FrameError: The image is not what the configured camera gives.
            SignalError: The capture time is not finite.
        """
        return self.on_detection(frame, self.question(frame)())

    def question(self, frame: Frame) -> Callable[[], Detection]:
        """What the vision is asked about a frame, to be called here or in another thread.

        It does not touch the loop: ticks may go on meanwhile. One frame after the other, each
        answer to `on_detection` before the next question.

        Raises:
            SignalError: The capture time is not finite.
        """
        captured_at = seconds("captured_at", frame.captured_at)
        predicted, expected = (
            self._loop.predicted_features(captured_at),
            self.expectation(captured_at),
        )
        detector = self._detector
        return lambda: detector.detect(frame.image, predicted, expected)

    def on_detection(self, frame: Frame, detection: Detection) -> Report:
        """The rest of `on_frame`, with the answer to `question`."""
        captured_at = seconds("captured_at", frame.captured_at)
        picture = checksum(frame.image)
        if not any(detection.found):
            return self._report(None, captured_at, detection, None, picture)
        return self._report(
            detection.features, captured_at, detection, detection.covariance, picture
        )

    def on_features(self, features: ArrayLike | None, captured_at: float) -> Report:
        """Image update from a marker detector of your own.

        Args:
            features: u and v of band A, u and v of band B (4,) [px]; NaN for both of a band that
                was not found, None if neither was.
            captured_at: When the frame was taken [s, the clock of `step`].

        Raises:
            SignalError: The features are not four numbers, finite for each band but for one that
                was not found, or the time is not finite.
        """
        values = None if features is None else features_of(features)
        return self._report(values, seconds("captured_at", captured_at), None)

    @property
    def supervision(self) -> Supervision:
        """How the loop stands now."""
        reaction, flags, latched, lead = self._loop.supervision
        return Supervision(Reaction(reaction), tuple(flags), tuple(latched), lead)

    def engage(self) -> None:
        """The operator re-engages: held motion goes on, its first increment zero.

        What is still wrong stops it again at once; what only a restart clears stays.
        """
        self._loop.engage()
        self._told("engage")

    def acknowledge(self) -> None:
        """The operator has seen the warnings; faded compensation may come back, with motion."""
        self._loop.acknowledge()
        self._told("acknowledge")

    def raise_flag(self, name: str) -> None:
        """Something only the rig can see: ``drive_fault``, ``following_error``.

        Raises:
            ConfigError: It is none of `tautscope.loop.safety.DETECTORS`.
        """
        self._loop.raise_flag(name)
        self._told(f"raise_flag {name}")

    def expectation(self, captured_at: float) -> Expectation | None:
        """Where the instrument should be in a frame captured at this time, to the best knowledge.

        The model's state with the correction of the last images and its standard deviation
        (crates/core/src/estimation/whereabouts.rs). It says where to look, never what to learn.
        None if not known.
        """
        belief = self._loop.expectation(captured_at)
        return None if belief is None else Expectation(*belief)

    def predicted_features(self, captured_at: float) -> NDArray[np.float64] | None:
        """Where to look in a frame captured at this time: h(q) (4,) [px], None if not known."""
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

    @cached_property
    def _detector(self) -> MarkerDetector:
        # Not every user of the loop has this package look at the images.
        from tautscope.loop.vision import MarkerDetector  # noqa: PLC0415

        return MarkerDetector(self._config)

    def _told(self, what: str) -> None:
        if self.on_event is not None:
            self.on_event(what)

    def _report(
        self,
        features: NDArray[np.float64] | None,
        captured_at: float,
        detection: Detection | None,
        covariance: NDArray[np.float64] | None = None,
        picture: int | None = None,
    ) -> Report:
        facts = self._loop.on_features(features, captured_at, covariance, picture)
        self.updates += 1
        now = self.supervision
        warnings = (*self._off, *now.flags)
        return Report(detection, captured_at, Status(facts[0]), *facts[1:], now.reaction, warnings)
