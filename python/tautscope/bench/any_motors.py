"""The simulated motors of a configuration, whatever their protocol.

``python -m tautscope.bench.any_motors --config FILE`` runs them in a process, without a plant: it
reads faults from its standard input, one per line (``freeze rotation``, ``clear rotation``), writes
events as JSON lines, and ends with its input, as ``tautscope bench``.
"""

import argparse
import json
import sys
import time
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.drives import SimulatedDrives
from tautscope.bench.events import print_events
from tautscope.bench.microcontroller import SimulatedMicrocontroller
from tautscope.bench.motors import OnCycle, SimulatedMotors
from tautscope.bench.requests import raise_errors_of_threads, serve_requests
from tautscope.bench.servos import SimulatedServos
from tautscope.config import DrivesConfig, load_config
from tautscope.config.microcontroller import PROTOCOL, SERIAL_PORTS
from tautscope.errors import ConfigError, TautscopeError
from tautscope.hardware.signals import exit_on_signals


def make_motors(
    config: DrivesConfig,
    resources: ExitStack,
    on_cycle: OnCycle | None = None,
    *,
    start: NDArray[np.float64],
    modes: tuple[int, ...] = (7, 8),
) -> SimulatedMotors:
    """The motors of a configuration, not yet running; `resources` closes their bus.

    ``drives.channel`` names the socket of the bus, or the link to the pseudo-terminal. The others
    are arguments of `SimulatedMotors` and `SimulatedDrives`.

    Raises:
        ConfigError: The configuration does not describe a bench, or a socket cannot be made.
    """
    if config.protocol in SERIAL_PORTS:
        if config.channel.startswith("/dev/"):
            raise ConfigError("drives.channel", config.channel, "no device, on the bench")
        if config.protocol == PROTOCOL:
            return SimulatedMicrocontroller(config, on_cycle, start=start)
        return SimulatedServos(config, on_cycle, start=start)
    if config.interface != "tautscope":
        raise ConfigError("drives.interface", config.interface, "tautscope, on the bench")
    try:
        resources.enter_context(Hub(config.channel))
    except OSError as error:
        allowed = f"a socket that can be made ({error}); is another bench running?"
        raise ConfigError("drives.channel", config.channel, allowed) from None
    bus = resources.enter_context(LocalBus(config.channel))
    return SimulatedDrives(bus, config, on_cycle, start=start, modes=modes)


def main() -> int:
    """Run simulated motors in a process; its exit status."""
    parser = argparse.ArgumentParser(description="Run simulated motors in a process.")
    parser.add_argument("--config", required=True, help="TOML with a section [drives]")
    modes = range(1, 11)  # of CiA 402
    parser.add_argument("--modes", type=int, nargs="+", choices=modes, default=[7, 8], metavar="N")
    parser.add_argument("--start", type=float, nargs="+", help="position of each motor [0]")
    try:
        _run(parser.parse_args())
    except TautscopeError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_status
    return 0


def _run(arguments: argparse.Namespace) -> None:
    config = load_config(arguments.config).drives
    if config is None:
        raise ConfigError("drives", None, "a section [drives]")
    count = len(config.all_motors)
    start = np.array(arguments.start or [0.0] * count)
    if len(start) != count:
        raise ConfigError("--start", arguments.start, f"{count} positions, one of each motor")
    with (
        exit_on_signals(),
        raise_errors_of_threads(),
        ExitStack() as resources,
        make_motors(config, resources, start=start, modes=tuple(arguments.modes)) as motors,
    ):
        print(json.dumps({"time": time.monotonic(), "what": "ready"}), flush=True)
        with print_events(lambda: motors.events):
            serve_requests(motors.request)


if __name__ == "__main__":
    sys.exit(main())
