"""Start of the console: the web server's process, then the control loop in this one."""

import multiprocessing
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from pathlib import Path

from tautscope.config import Config
from tautscope.console.rig_control import RigControl
from tautscope.console.server import ADDRESS, run_server
from tautscope.console.session import Session
from tautscope.console.shared import Channels, SharedMemory
from tautscope.errors import STOPPED, ConfigError, StateError, may_move
from tautscope.hardware.realtime import LOOP, OTHERS, VISION, realtime_executor, realtime_process
from tautscope.hardware.rig import HardwareRig
from tautscope.hardware.signals import exit_on_signals
from tautscope.loop.rig import Rig


def start_console(
    rig: Rig, config: Config, folder: Path, port: int, announce: Callable[[str], None]
) -> int:
    """Serve the console of a rig until Ctrl-C; the exit status.

    Args:
        rig: In real time, as for `RigControl`.
        config: Settings.
        folder: New; for logs and stills.
        port: Port on 127.0.0.1; 0 is a free one.
        announce: Called with the page's address.

    Raises:
        ConfigError: The port is taken, or there is no kinematics of this name.
        StateError: The web server ended, or motors may still move.
    """
    with (
        realtime_executor("vision", VISION) as executor,
        exit_on_signals(),
        web_server(config, port) as (server, channels, url),
    ):
        control = RigControl(config, rig, folder, executor)
        announce(url)
        with realtime_process(OTHERS if isinstance(rig, HardwareRig) else LOOP):
            try:
                Session(control, channels, lambda: not server.is_alive()).main()
            except KeyboardInterrupt as stop:
                if may_move(stop):
                    raise
                return 0
    error = StateError("web server", "it ended", "Motion is stopped. Start the console again")
    error.exit_status = STOPPED
    raise error


@contextmanager
def web_server(config: Config, port: int) -> Iterator[tuple[BaseProcess, Channels, str]]:
    """A web server in a process of its own, this process's channels, and the page's address.

    Raises:
        ConfigError: The port is taken.
    """
    context = multiprocessing.get_context("spawn")
    memory, token = SharedMemory(context, config), secrets.token_urlsafe(32)
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((ADDRESS, port))
        except OSError as error:
            raise ConfigError("port", port, f"a free port ({error.strerror})") from None
        listener.listen(64)
        url = f"http://{ADDRESS}:{listener.getsockname()[1]}/#token={token}"
        process = context.Process(
            target=run_server, args=(memory, token, [listener]), name="web server", daemon=True
        )
        process.start()
    try:
        yield process, Channels(memory), url
    finally:
        process.terminate()
        process.join(2.0)
