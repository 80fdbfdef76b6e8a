"""The command ``tautscope align``: delay between motors and images of a record."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from tautscope.commands import arguments, positions
from tautscope.commands.printing import print_json, print_warnings

if TYPE_CHECKING:
    from tautscope.calibration.delay import DelayEstimate

NO_ANSWER = 1


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    align = arguments.add_verb(
        verbs,
        "align",
        _run,
        help="delay between motors and images of a log, or of a video with motor positions",
        description="Estimate the delay of the images behind the motors, and the drift of their "
        "clocks, from a log or from a video with motor positions. Two probes must agree; without "
        "an answer the exit status is 1. The motors must have stopped or turned several times.",
        extras=["hardware"],
    )
    positions.add_video_options(
        align, "about the time of the video's first frame in the motors' [s]"
    )
    align.add_argument(
        "--within",
        type=arguments.above_zero,
        default=5.0,
        metavar="S",
        help="largest delay that is searched [s] [%(default)s]",
    )
    arguments.add_config(align)
    arguments.add_json(align)


def _run(options: argparse.Namespace) -> int:
    from tautscope.log.alignment import align_recording, implausible_motors  # noqa: PLC0415
    from tautscope.log.reader import read_log  # noqa: PLC0415

    positions.check_video_options(options)
    if options.video is None:
        arguments.refuse_unused(options, "--video: a log has its configuration", "config")
    document: dict[str, Any] = {}
    if options.video is None:
        log = read_log(options.file)
        found = align_recording(log.recording(), options.within)
        camera_delay = log.config.camera.source.delay + found.delay
        document["camera_delay"] = camera_delay if found.is_known else None
        remedy = f"To correct it, set camera.source.delay = {max(camera_delay, 0.0):.3f}"
        if camera_delay < -2 * found.delay_std:
            remedy = "The images are stamped before they are captured: check camera.source.clock"
    else:
        config = arguments.article_config(options.config)
        motors = positions.read_positions(options.motors, options.units, config)
        found, stamps = positions.align_video_options(options, config, motors, limit=options.within)
        start = float(stamps[0]) - found.delay
        document["video_start"] = start if found.is_known else None
        remedy = f"The first image shows the motors at {start:.3f} s: --video-start {start:.3f}"
    notes = list(implausible_motors(found))
    print_json(options, {**found.to_json(), **document, "notes": notes})
    print_delay(found)
    if found.is_known:
        print(f"{remedy}.")
    print_warnings(notes)
    return 0 if found.is_known else NO_ANSWER


def print_delay(found: DelayEstimate) -> None:
    """Print the estimate and its probes, or why there is none."""
    if found.is_known:
        early = "late" if found.delay >= 0 else "early"
        print(f"Images are {abs(found.delay):.3f} s {early} (std {found.delay_std:.3f} s).")
        if found.drift:
            print(
                f"Their clock drifts by {1e6 * found.drift:.0f} ppm "
                f"(std {1e6 * found.drift_std:.0f} ppm); the delay is that of the first image."
            )
        else:
            print(f"No drift of the clocks was found (std {1e6 * found.drift_std:.0f} ppm).")
    else:
        print(f"No answer: {found.reason}.")
    for name, probe in (("model", found.model), ("turning points", found.turning_points)):
        if probe is not None:
            print(
                f"  {name}: {probe.middle:.3f} s in the middle of the record "
                f"(std {probe.delay_std:.3f} s), drift {1e6 * probe.drift:.0f} ppm "
                f"(std {1e6 * probe.drift_std:.0f} ppm), from {probe.parts} parts"
            )
