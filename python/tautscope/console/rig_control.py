"""The rig and its control loop, switched on and off by the operator."""

import logging
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from tautscope.config import Config
from tautscope.console.control_run import ControlRun, warm_up
from tautscope.console.lease import ImageTimes, Lease
from tautscope.console.operator_input import OperatorInput
from tautscope.console.paced_rig import PacedRig
from tautscope.errors import EMERGENCY_STOP, STOPPED, StateError, TautscopeError, described
from tautscope.hardware.rig import HardwareRig
from tautscope.log.writer import LogWriter
from tautscope.loop.kinematics import build_kinematics
from tautscope.loop.rig import Rig, Sample, check_sample, disable, reset_unless

_LOG = logging.getLogger(__name__)
INTERRUPTED = "STOP, or the page was away, while they were being enabled"


class RigControl:
    """Starts and ends runs of the control loop.

    The rig is one in real time: a `LiveTwin`, `HardwareRig`, or a rig of the user's as a
    `PacedRig`. Logs and stills are in the folder; the executor runs the marker detection.

    Attributes:
        images: When images were published, or without images states.
        kinematics: Of an instrument with [[dof]], if it has positions.
        run: The present run; None while the rig is off.
        log: That of the last run; None before one.
        fault: Why the rig is off; empty if it is not, or was never on.
        unconfirmed: Why the motors may still move although they were stopped; empty if they do not.
        is_interrupted: Whether opening has to end, or had to: by STOP, or without a page.
        stopped_at: When the newest STOP took effect [s, monotonic clock]; None before one.
        ended_at: When motion was last stopped, or the rig went off [s, monotonic clock].
        compensation: Share of the compensation that the operator has chosen.
        while_opening: Called periodically, in another thread, while the rig opens: this takes
            seconds, in which commands have to be received.
    """

    def __init__(self, config: Config, rig: Rig, folder: Path, executor: Executor) -> None:
        self.config = config.replace(**{"recording.image_format": "jpeg"})
        self.folder = folder
        self.images = ImageTimes()
        self.lease = Lease(self.images)
        self.operator = OperatorInput(config, self.lease)
        self.run: ControlRun | None = None
        self.log: LogWriter | None = None
        self.fault = self.unconfirmed = ""
        self.is_opening = self.is_interrupted = self.is_recording = False
        self.stopped_at: float | None = None
        self.ended_at = -math.inf
        self._warnings: set[str] = set()
        self.compensation = 1.0
        self.while_opening: Callable[[], None] = lambda: None
        self.kinematics = build_kinematics(config) if config.dof else None
        self._rig, self._executor = rig, executor
        warm_up(config)
        if isinstance(rig, HardwareRig):
            rig.warn = self.warn
        self._runs = 0
        self._endings: list[threading.Thread] = []

    @property
    def is_hardware(self) -> bool:
        """Whether real motors move."""
        rig = self._rig
        return isinstance(rig, HardwareRig) or (isinstance(rig, PacedRig) and not rig.is_simulated)

    def open(self) -> None:
        """Enable the rig and start a run; a STOP, or a page that is gone, interrupts it."""
        self.fault, self.is_opening, self.is_interrupted = "", True, False
        try:
            sample = check_sample(reset_unless(self._rig, self._must_stop), self.config)
        except TautscopeError as error:
            found = described(error)
            if self.is_interrupted and EMERGENCY_STOP not in found:
                found = INTERRUPTED
            self._stop_motors(found)
            return
        finally:
            self.is_opening = False
        self.unconfirmed = ""
        self.operator.reset(np.array(sample.applied, np.float64))
        self._start_run(sample)

    def close(self, fault: str = "", *, is_disabling: bool = False) -> None:
        """End the run; motors are quick-stopped, with `is_disabling` also without power."""
        run, self.run = self.run, None
        self.operator.interrupt()
        self.fault = fault
        if run is None:
            return
        self._stop_motors(fault, is_disabling=is_disabling)
        if self.fault:
            run.note(f"rig off: {self.fault}")
        self._end(run)

    def restart(self, config: Config) -> None:
        """Start a new run with other settings; the command stays where it is."""
        self.config = config
        if (run := self.run) is not None:
            self.operator.reset(run.command)
            self._end(run)
            self._start_run(run.sample)

    def stop(self, reason: str) -> None:
        """Stop motion until it is enabled; motors are quick-stopped."""
        self.operator.stop(reason)
        self.stopped_at = self.ended_at = time.monotonic()
        if self.run is not None:
            self.run.note(reason)
            if self.is_hardware:
                self.close(reason)

    @property
    def warnings(self) -> set[str]:
        """The flags since the last acknowledgement, also of runs that have ended."""
        latched = () if self.run is None else self.run.loop.supervision.latched
        return self._warnings.union(latched)

    def acknowledge(self) -> None:
        """Forget the warnings."""
        self._warnings.clear()
        if self.run is not None:
            self.run.loop.acknowledge()

    def note(self, text: str) -> None:
        """Write a note into the log, if there is one."""
        if self.run is not None:
            self.run.note(text)

    def warn(self, text: str) -> None:
        """Warn, also in the log if there is one; for any thread."""
        _LOG.warning("%s", text)
        if (run := self.run) is not None:
            run.log.warn(text)

    def record(self, *, is_recording: bool) -> None:
        """Keep images as they are (PNG), or as JPEG, which takes a fifth of the space."""
        self.is_recording = is_recording
        if self.run is not None:
            self.run.log.image_format = "png" if is_recording else "jpeg"

    def shut_down(self) -> None:
        """Stop the motors, release the rig, and wait for the logs.

        Raises:
            StateError: The motors may still move: their drives did not confirm the last stop.
        """
        self.close()
        self._stop_motors("")  # of a rig that was being enabled
        self._rig.close()
        for thread in self._endings:
            thread.join()
        if self.unconfirmed:
            what = f"the motors may still move ({self.unconfirmed})"
            error = StateError("rig", what, EMERGENCY_STOP)
            error.exit_status = STOPPED
            raise error

    def _stop_motors(self, fault: str, *, is_disabling: bool = False) -> None:
        self.fault, unconfirmed = fault, ""
        try:
            if self.is_hardware and is_disabling:
                disable(self._rig)
            elif self.is_hardware:
                self._rig.close()
        except TautscopeError as error:
            unconfirmed = described(error)
            self.fault = f"{fault}; {unconfirmed}" if fault else unconfirmed
        if EMERGENCY_STOP in fault:
            unconfirmed = fault
        if unconfirmed:
            _LOG.warning("%s", unconfirmed)
            self.unconfirmed = unconfirmed
        self.ended_at = time.monotonic()

    def _start_run(self, sample: Sample) -> None:
        self._runs += 1
        path = self.folder / f"console-{self._runs}.mcap"
        try:
            self.run = ControlRun(
                self.config, self._rig, sample, self.operator, path=path, executor=self._executor
            )
        except TautscopeError as error:
            self.run = None
            self._stop_motors(described(error))
            return
        self.run.set_compensation(self.compensation)
        self.log = self.run.log

    def _end(self, run: ControlRun) -> None:
        """End the take, keep the warnings, and close the log in the background: disks are slow."""
        if self.is_recording:  # a take is in one log
            run.note("the take ends with its log")
            self.is_recording = False
        self._warnings.update(run.loop.supervision.latched)
        thread = threading.Thread(target=run.log.close, name="closing")
        self._endings = [each for each in self._endings if each.is_alive()]
        self._endings.append(thread)
        thread.start()

    def _must_stop(self) -> bool:
        """Whether the motors, which are being enabled, have to stop."""
        self.while_opening()
        operator = self.operator
        is_wanted = not operator.stopped_by and operator.is_present(time.monotonic())
        self.is_interrupted |= self.is_hardware and not is_wanted
        return self.is_interrupted
