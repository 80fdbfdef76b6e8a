"""A hardware rig with fake motors and a fake camera."""

import threading
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from drive_settings import EXPERIMENT, drives_document
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config, from_document
from tautscope.hardware.cameras import CameraState, Capture
from tautscope.hardware.rig import HardwareRig
from tautscope.loop.rig import Frame

HOME = np.array([0.01, 0.5, 0.2])
CYCLE = 0.01


class FakeMotors:
    """Motors that follow ideally and record their commands."""

    def __init__(self) -> None:
        self.commands: list[NDArray[np.float64]] = []
        self.threads: set[str] = set()
        self.stopped = self.disabled = 0
        self.meanwhile: Callable[[], object] = lambda: None

    def start(self) -> NDArray[np.float64]:
        return HOME.copy()

    def exchange(self, command: ArrayLike) -> NDArray[np.float64]:
        self.meanwhile()
        self.threads.add(threading.current_thread().name)
        self.commands.append(np.array(command))
        return np.array(command)

    def stop(self) -> None:
        pass

    def disable(self) -> None:
        self.disabled += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.stopped += 1


class FakeCamera:
    """A camera that delivers one frame after each call of `provide`."""

    def __init__(self) -> None:
        self.next: Capture | None = None
        self.trouble = ""
        self.closed = 0

    def provide(self, captured_at: float, value: int, sequence: int = 0) -> None:
        image = np.full((4, 4, 3), value, np.uint8)
        self.next = Capture(Frame(image, captured_at, sequence), captured_at)

    @property
    def state(self) -> CameraState:
        return CameraState(trouble=self.trouble)

    def newest(self) -> Capture | None:
        taken, self.next = self.next, None
        return taken

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.closed += 1


class Setup:
    """A rig with its fake motors and camera."""

    def __init__(self, **changes: Any) -> None:
        self.motors, self.camera, self.warnings = FakeMotors(), FakeCamera(), list[str]()
        self.config = rig_config(**changes)
        self.rig = HardwareRig(self.config)
        self.rig._open_motors = lambda: self.motors  # type: ignore[method-assign]
        self.rig._open_camera = lambda: self.camera  # type: ignore[method-assign]
        self.rig.warn = self.warnings.append


def rig_config(
    drives: dict[str, Any] | None = None,
    source: dict[str, Any] | None = None,
    period: float = CYCLE,
) -> Config:
    defaults = {"cycle": CYCLE, "reply_timeout": 0.009, "command_timeout": 60.0, "start_speed": 0.9}
    patient = {"timeout": 60.0, "lost_timeout": 60.0}
    return from_document(
        {
            "control": {"period": period},
            "drives": drives_document(**(defaults | (drives or {}))),
            "camera": {"source": patient | (source or {})},
            "experiment": EXPERIMENT,
        }
    )
