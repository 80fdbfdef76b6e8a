"""What the holder of the lease may request beside motion, and the lease itself."""

import shlex
import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import to_bgr
from tautscope.console import messages as msg
from tautscope.console.programs import PROGRAMS, program, programs_of
from tautscope.console.rig_control import RigControl
from tautscope.errors import ConfigError
from tautscope.loop.safety import Reaction


class Actions:
    """Executes requests; each is refused or executed completely, and noted in the log."""

    def __init__(
        self, control: RigControl, newest_image: Callable[[], NDArray[np.uint8] | None]
    ) -> None:
        self._control, self._newest_image = control, newest_image
        self._takes = self._stills = 0
        self._text, self._take_began = "", 0.0

    def execute(self, inbound: msg.Received | msg.Gone) -> msg.Reply | None:
        """Execute a message; the reply to its page, if there is one."""
        control = self._control
        if isinstance(inbound, msg.Gone):
            if control.lease.release(inbound.client):
                control.operator.interrupt("the page is gone")
                control.note(f"page {inbound.client} is gone; the lease is free")
            return None
        client, message = inbound.client, inbound.message
        if isinstance(message, msg.Take):
            control.operator.interrupt("control was taken")
            control.lease.take(client)
            control.note(f"page {client} takes lease {control.lease.number}")
            return msg.Reply(client, "take", True)
        if not isinstance(message, msg.Request):
            return None
        what = message.name if isinstance(message, msg.Action | msg.Setting) else "profile"
        self._text = ""
        moves, now = what in PROGRAMS, time.monotonic()
        reason = control.lease.refusal(client, message, now, needs_image=moves)
        if not reason and what == "enable" and inbound.at <= control.ended_at:
            # It waited, at a link that stood or while the rig opened, and must not undo the stop.
            reason = "motion was stopped after it, press Enable again"
        if reason:
            control.operator.count_refusal(reason)
        else:
            reason = self._execute(message)
        if not reason:
            control.note(f"page {client}: {_described(message)}")
        return msg.Reply(client, what, not reason, (reason or self._text)[: msg.LONGEST_REASON])

    def _execute(self, message: msg.Request) -> str:
        """Execute a request; why it cannot be, else empty."""
        if isinstance(message, msg.Setting):
            return self._set(message)
        if isinstance(message, msg.SetProfile):
            return self._set_profile(message)
        if message.name in PROGRAMS:
            return self._start_program(message.name)
        reason: str | None = getattr(self, f"_{message.name}")()
        return reason or ""

    def _set(self, setting: msg.Setting) -> str:
        operator = self._control.operator
        if setting.name == "compensation":
            self._control.compensation = setting.value
            if self._control.run is not None:
                self._control.run.set_compensation(setting.value)
            return ""
        names = [dof.label for dof in self._control.config.dofs]
        if setting.dof not in names:
            return f"no degree of freedom {setting.dof!r}"
        operator.interrupt()
        index = names.index(setting.dof)
        if setting.name == "scale":
            operator.scale[index] = setting.value
        else:
            operator.is_coupled[index] = setting.value > 0
        return ""

    def _set_profile(self, message: msg.SetProfile) -> str:
        control = self._control
        if control.operator.is_moving:
            return "the instrument moves"
        if control.run is not None and control.run.is_held:
            return "motion is held, press Enable first"  # the new loop would not hold it
        if message.profile != control.config.profile:
            try:
                config = control.config.replace(profile=message.profile)
            except ConfigError as error:
                return str(error)
            control.restart(config)
        return ""

    def _start_program(self, name: str) -> str:
        control = self._control
        operator, run = control.operator, control.run
        if name not in programs_of(control.config):
            return "only the article's instrument has this program"
        if run is None or operator.stopped_by or run.is_held:
            return "motion is stopped"
        if not operator.is_present(time.monotonic()):
            return "no command for 0.1 s"
        operator.start(program(name, control.config, operator.reference))
        return ""

    # Requests by their names; each returns why it cannot be executed, if it cannot.

    def _end_program(self) -> None:
        self._control.operator.interrupt("End program")

    def _enable(self) -> str:
        control, run = self._control, self._control.run
        control.operator.enable()
        if run is None:
            control.open()
            return control.fault
        if run.loop.supervision.reaction is Reaction.DISABLE:
            control.restart(control.config)
        elif run.is_held:
            run.loop.engage()
        return ""

    def _acknowledge(self) -> None:
        self._control.acknowledge()

    def _release(self) -> None:
        self._control.operator.interrupt("control was given up")
        self._control.lease.take(None)

    def _mark(self) -> str:
        return "" if self._control.run is not None else "there is no log"

    def _record(self) -> str:
        control, run = self._control, self._control.run
        if run is None:
            return "there is no log"
        control.record(is_recording=not control.is_recording)
        if control.is_recording:
            self._takes += 1
            self._take_began = run.sample.time
            self._text = f"take {self._takes}, lossless, into {run.path}"
        else:
            self._text = (
                f"take {self._takes} is in {run.path}, from {self._take_began:.0f} to "
                f"{run.sample.time:.0f} s. See it again: {replay_command(run.path)}"
            )
        control.note(f"take {self._takes} {'begins' if control.is_recording else 'ends'}")
        return ""

    def _still(self) -> str:
        image, control = self._newest_image(), self._control
        if image is None:
            return "there is no image"
        self._stills += 1
        path = control.folder / f"still-{self._stills}.png"
        pixels, kind = image.copy(), control.config.camera.pixel_format

        def write() -> None:
            try:
                path.write_bytes(cv2.imencode(".png", to_bgr(pixels, kind))[1].tobytes())
            except OSError as error:
                control.warn(f"the still {path} was not written ({error})")

        threading.Thread(target=write, name="still").start()  # takes longer than a tick
        self._text = f"the image is in {path}"
        return ""


def replay_command(path: Path) -> str:
    """The command that shows a log on the page."""
    return shlex.join(["tautscope", "console", "--replay", str(path)])


def _described(message: msg.Request) -> str:
    if isinstance(message, msg.SetProfile):
        return f"profile {message.profile}"
    if isinstance(message, msg.Setting):
        dof = f" {message.dof}" if message.name != "compensation" else ""
        return f"{message.name}{dof} {message.value:g}"
    return f"{message.name} {message.text}".strip()
