"""The command ``tautscope bench``."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.bench.events import print_events
from tautscope.bench.requests import raise_errors_of_threads, serve_requests
from tautscope.commands import arguments
from tautscope.config.microcontroller import SERIAL_PORTS
from tautscope.dof import Dof
from tautscope.errors import ConfigError, OutputError
from tautscope.hardware.signals import exit_on_signals

if TYPE_CHECKING:
    from tautscope.bench.rig import Bench


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    bench = arguments.add_verb(
        verbs,
        "bench",
        _bench,
        help="run a simulated rig: drives and a camera for `tautscope run`",
        description="Run a simulated rig for another process: the simulated instrument behind "
        "three CiA 402 drives on a CAN bus, or servos or a microcontroller on a serial line "
        "(--config bench_dynamixel, bench_feetech, bench_serial), and a camera stream, in real "
        "time. Ends with its input, Ctrl-C or SIGTERM; in the background, where it has no input, "
        "with a signal only. A line of input injects a fault: KIND PART, with the part insertion, "
        "rotation, bending (drop, delay, fault, freeze; drives also heartbeat, refuse; on a serial "
        "line also restart, unplug) or camera (drop, delay, fault: "
        "unplugged, freeze, board: a calibration board is shown); clear PART ends it. Events are "
        "written as JSON lines.",
        extras=["hardware", "twin"],
    )
    arguments.add_config(bench, default="bench")
    bench.add_argument(
        "--faults",
        nargs="+",
        type=_fault,
        default=[],
        metavar="'S KIND PART'",
        help="inject a fault S seconds after the motors are enabled",
    )
    bench.add_argument(
        "--truth", type=Path, metavar="FILE.csv", help="write the true tip state, for evaluation"
    )
    bench.add_argument(
        "--drawn",
        type=arguments.natural,
        metavar="SEED",
        help="simulate a rig that differs from its configuration, as `calibrate --twin`",
    )
    bench.add_argument(
        "--modes",
        type=int,
        nargs="+",
        choices=range(1, 11),
        default=[7, 8],
        metavar="N",
        help="modes of operation that CiA 402 drives support, of 1 to 10 [7 8]",
    )


def _fault(text: str) -> tuple[float, str]:
    seconds, _, request = text.partition(" ")
    try:
        return arguments.seconds(seconds), request
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected 'SECONDS KIND PART'") from None


def _bench(options: argparse.Namespace) -> None:
    from tautscope.bench.rig import Bench  # noqa: PLC0415
    from tautscope.hardware.realtime import (  # noqa: PLC0415
        SETPOINTS,
        realtime_process,
        short_switch_interval,
    )

    config = arguments.article_config(options.config)
    if config.drives is not None and config.drives.protocol in SERIAL_PORTS:
        arguments.refuse_unused(options, "CiA 402 drives, in --config", "modes")
    if options.truth is not None and options.truth.is_file():
        raise OutputError("--truth", str(options.truth), "a file that does not exist yet")
    if options.drawn is not None:
        from tautscope.twin.drawn_rig import draw_rig  # noqa: PLC0415

        config = draw_rig(config, options.drawn)
    with (
        exit_on_signals(),
        raise_errors_of_threads(),
        short_switch_interval(),
        realtime_process(SETPOINTS) as refusal,
        Bench(config, options.truth, modes=tuple(options.modes)) as bench,
    ):
        _check_faults(bench, options.faults)
        if refusal:
            print(f"warning: {refusal}", file=sys.stderr, flush=True)
        print(json.dumps({"time": time.monotonic(), "what": "ready"}), flush=True)
        stopping = threading.Event()
        injector = threading.Thread(
            target=_inject_faults, args=(bench, sorted(options.faults), stopping)
        )
        injector.start()
        with print_events(lambda: bench.events):
            try:
                serve_requests(bench.request)
            finally:
                stopping.set()
                injector.join()


def _check_faults(bench: Bench, faults: Iterable[tuple[float, str]]) -> None:
    """Check that a bench has the faults of ``--faults``."""
    from tautscope.bench.camera import FAULTS  # noqa: PLC0415

    kinds = dict.fromkeys((dof.label for dof in Dof), bench.drives.kinds) | {"camera": FAULTS}
    for _, request in faults:
        kind, _, part = request.partition(" ")
        if part not in kinds or kind not in ("clear", *kinds[part]):
            allowed = "; ".join(f"{', '.join(kinds[each])} of {each}" for each in kinds)
            raise ConfigError("--faults", request, f"KIND PART, with {allowed}; or clear PART")


_ENABLED = ("operation enabled", "torque on", "enabled")
"""Events of enabled motors: of CiA 402, servos, a microcontroller."""


def _inject_faults(
    bench: Bench, faults: list[tuple[float, str]], stopping: threading.Event
) -> None:
    """Inject each fault at its time after the motors were first enabled."""
    enabled_at: float | None = None
    while faults and not stopping.wait(0.01):
        if enabled_at is None:
            enabled = [e.time for e in bench.events if e.what in _ENABLED]
            enabled_at = enabled[0] if enabled else None
        elif time.monotonic() >= enabled_at + faults[0][0]:
            bench.request(faults.pop(0)[1])
