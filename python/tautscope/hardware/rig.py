"""A rig of drives and a live camera, in a laboratory or on the bench."""

import logging
import time
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from tautscope.dof import Dof
from tautscope.errors import CameraError
from tautscope.hardware.cameras import Camera, CameraState, Capture
from tautscope.hardware.motor_rig import MotorRig
from tautscope.loop.rig import Frame, Sample

_LOG = logging.getLogger(__name__)


class HardwareRig(MotorRig):
    """The article's drives and a live camera, with the clock of `MotorRig`.

    Args:
        config: With a section ``drives``; a run starts at the centres of ``experiment``.

    Raises:
        ConfigError: As of `MotorRig`.
    """

    _camera: Camera | None = None
    _last_capture: Capture | None = None
    _new_frame_at = 0.0
    _trouble, _is_frozen = "", False

    @property
    def start(self) -> NDArray[np.float64]:
        """Centres of the experiment."""
        return np.array([self._config.experiment[dof].centre for dof in Dof])

    def reset(self) -> Sample:
        """Open and test the camera, enable the motors, move to the start; the clock is at 0.

        Raises:
            CameraError: The camera is missing, or its frames cannot be used.
            DriveError: A drive is missing, differs from its configuration, or failed.
        """
        sample = super().reset()
        self._last_capture, self._trouble, self._is_frozen = None, "", False
        self._new_frame_at = time.monotonic()
        return sample

    def _open_camera(self) -> Camera:
        return Camera(self._config.camera, time.monotonic)

    def _open_sensors(self, resources: ExitStack) -> None:
        self._camera = resources.enter_context(self._open_camera())
        _LOG.info("camera %s: frames arrive", self._config.camera.source.url)

    def _sample(self, time: float, applied: NDArray[np.float64]) -> Sample:
        assert self._camera is not None
        return Sample(time, applied, self._newest_frame(self._camera))

    def _newest_frame(self, camera: Camera) -> Frame | None:
        """The newest frame on the rig's clock; None if it repeats the last image."""
        now = time.monotonic()
        capture = camera.newest()
        is_new = capture is not None and not (
            self._last_capture is not None
            and np.array_equal(capture.frame.image, self._last_capture.frame.image)
        )
        if is_new:
            self._new_frame_at = now
        if capture is not None:
            self._is_frozen = not is_new
        self._check_camera(camera.state, now)
        if capture is None or not is_new:
            return None
        self._last_capture = capture
        self.timing.add_frame(capture.frame.captured_at, capture.arrived_at, now)
        captured_at = self.to_rig_time(capture.frame.captured_at)
        return Frame(capture.frame.image, captured_at, capture.frame.sequence)

    def _check_camera(self, state: CameraState, now: float) -> None:
        source = self._config.camera.source
        silence = now - self._new_frame_at
        trouble = state.trouble
        what = "only repetitions of one image" if self._is_frozen else "no image"
        if not trouble and silence > source.timeout:
            trouble = f"{what} for {source.timeout:g} s; is the camera on and connected?"
        if silence > source.lost_timeout:
            raise CameraError(
                "camera.source",
                f"{what} for {source.lost_timeout:g} s",
                "new images; the motors are stopped. Check the camera, its cable and the video "
                "processor, then start again",
            )
        if bool(trouble) != bool(self._trouble):
            self.warn(f"camera: {trouble}" if trouble else "camera: new frames again")
        self._trouble = trouble
