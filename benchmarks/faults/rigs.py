"""Rigs of the fault campaign: a twin without images, and drives that protect themselves."""

import math
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from common.features import FeatureCamera
from common.paths import ROOT
from faults.recorder import QUICK_STOP, Floats, RunRecorder
from numpy.typing import ArrayLike
from tautscope.config import Config, load_config
from tautscope.hardware.following_error import FollowingErrorMonitor
from tautscope.hardware.motor_rig import require_drives
from tautscope.loop.rig import Sample
from tautscope.loop.safety import Reaction
from tautscope.twin import Twin
from tautscope.twin.faults import FaultyRig

DRIVES = require_drives(load_config(ROOT / "configs" / "bench.toml"))
"""Drives whose following-error limits apply: those of the bench."""


class FeatureTwin(Twin):
    """Twin with a `FeatureCamera` in place of rendered images.

    Attributes:
        truth: True state after each tick, each (3,) [m, rad, rad].
        commands: Command of each tick, likewise.
    """

    def __init__(self, config: Config) -> None:
        super().__init__(config, images=False)
        self._feature_camera = FeatureCamera(config)
        self.truth: list[Floats] = []
        self.commands: list[Floats] = []

    def reset(self) -> Sample:
        """See `Twin.reset`."""
        return self._with_frame(super().reset())

    def step(self, command: ArrayLike) -> Sample:
        """See `Twin.step`."""
        sample = self._with_frame(super().step(command))
        if sample.true_state is not None:
            self.truth.append(sample.true_state)
        self.commands.append(np.array(command, dtype=np.float64))
        return sample

    def _with_frame(self, sample: Sample) -> Sample:
        frame = self._feature_camera.capture(sample)
        return sample if frame is None else replace(sample, frame=frame)


class ProtectedRig:
    """Rig whose drives monitor their following error and can be stopped.

    Args:
        rig: Rig that the drives move; may be exchanged during a run.
        recorder: Receives the flags of the drives, and says when the loop requests a quick stop.
        monitors: Active monitors: `following_error`, `drive_fault`.
        callback_time: When `callback` is called [s].
        callback: Called once, before the first tick at that time.
    """

    def __init__(
        self,
        rig: FaultyRig,
        recorder: RunRecorder,
        monitors: Collection[str] = ("following_error", "drive_fault"),
        callback_time: float = math.inf,
        callback: Callable[[], None] | None = None,
    ) -> None:
        self.rig, self._recorder, self._monitors = rig, recorder, monitors
        self._callback_time, self._callback = callback_time, callback
        self._following = FollowingErrorMonitor(DRIVES, rig.control_period)
        self._is_stopped = False

    @property
    def control_period(self) -> float:
        """Control period [s]."""
        return self.rig.control_period

    def reset(self) -> Sample:
        """See `Rig.reset`."""
        sample = self.rig.reset()
        self._following.reset(sample.applied)
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """See `Rig.step`; stopped drives do not move."""
        if self._callback is not None and self.rig.true_time >= self._callback_time - 1e-9:
            callback, self._callback = self._callback, None
            callback()
        if self._recorder.rank >= QUICK_STOP and not self._is_stopped:
            self.stop()
        target = np.asarray(command, dtype=np.float64)
        sample = self.rig.step(target)
        if self._monitors and not self._is_stopped:
            self._check(target, sample.applied)
        return sample

    def close(self) -> None:
        """See `Rig.close`."""
        self.rig.close()

    def stop(self) -> None:
        """Stop the drives and close the brakes."""
        self._is_stopped = True
        self.rig.brake()

    def _check(self, target: Floats, applied: Floats) -> None:
        is_following = not self._following.update(target, applied).any()
        if "drive_fault" in self._monitors and self.rig.drive_fault:
            self._trip("drive_fault")
        elif "following_error" in self._monitors and not is_following:
            self._trip("following_error")

    def _trip(self, flag: str) -> None:
        now = self.rig.true_time
        self.stop()
        if self._recorder.loop is not None:
            self._recorder.loop.raise_flag(flag)
        self._recorder.record_flag(flag, now)
        self._recorder.record_reaction(now, Reaction.QUICK_STOP)
