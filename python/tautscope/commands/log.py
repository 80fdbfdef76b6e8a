"""Command line: ``tautscope recover``, ``export`` and ``replay``."""

from __future__ import annotations

import argparse
import logging
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautscope.commands import arguments, positions
from tautscope.commands.printing import print_json, print_warnings, progress_bar
from tautscope.config import Config, load_config
from tautscope.errors import FieldError
from tautscope.extras import require_extras
from tautscope.hardware.video import read_video
from tautscope.log.comparison import write_replay
from tautscope.runs.output_folder import check_free

if TYPE_CHECKING:
    from tautscope.log.mcap_records import Damage
    from tautscope.log.reader import Log

_LOG = logging.getLogger(__name__)
TOLERANCE = 0.1
"""Error of a given ``--video-start`` above which a warning is printed [s]."""


def add_parsers(verbs: arguments.Verbs) -> None:
    """Add the three commands."""
    recover = arguments.add_verb(
        verbs,
        "recover",
        _recover,
        help="repair a truncated log",
        description="Copy the undamaged messages of a log into a new file that every MCAP reader "
        "can open. The old file is not changed.",
        extras=["hardware"],
    )
    recover.add_argument("file", type=Path, metavar="FILE.mcap")
    recover.add_argument(
        "--out", type=Path, metavar="FILE", help="new file [FILE-recovered.mcap beside it]"
    )
    arguments.add_json(recover)

    export = arguments.add_verb(
        verbs,
        "export",
        _export,
        help="export a log as CSV, as a rosbag2 folder or for Rerun",
        description="Export a log, complete or truncated, as CSV (one line per tick, one line per "
        "update), as a rosbag2 folder, or as a recording with a blueprint for the Rerun viewer.",
        extras=["hardware"],
    )
    export.add_argument("file", type=Path, metavar="FILE.mcap")
    kinds = export.add_mutually_exclusive_group(required=True)
    kinds.add_argument(
        "--csv",
        type=Path,
        nargs="?",
        const=False,
        metavar="DIR",
        help="folder, new or empty [FILE-csv beside it]",
    )
    kinds.add_argument("--rosbag", type=Path, metavar="DIR", help="folder, new or empty")
    kinds.add_argument(
        "--rerun", type=Path, metavar="FILE.rrd", help="new file; needs the extra `rerun`"
    )
    arguments.add_json(export)

    replay = arguments.add_verb(
        verbs,
        "replay",
        _replay,
        help="replay a log, or a video with motor positions",
        description="Replay the inputs of a log through the loop. With the log's configuration the "
        "outputs must be identical, bit for bit (exit status 1 if not). With another "
        "configuration, or from a video and a table of motor positions, estimate states and "
        "offsets only. The delay of the video is estimated from the record.",
        extras=["hardware"],
    )
    positions.add_video_options(
        replay, "time of the video's first frame in the motors' [s] [estimated, see `align`]"
    )
    arguments.add_config(replay)
    arguments.add_profile(replay, "how the backlash is estimated")
    arguments.add_out(replay, "replay")
    arguments.add_json(replay)


def _recover(options: argparse.Namespace) -> None:
    from tautscope.log.export import recover  # noqa: PLC0415

    file: Path = options.file
    recovery = recover(file, options.out or _beside(file, "-recovered.mcap"))
    duration = (recovery.last - recovery.first) / 1e9
    document = {
        "file": str(recovery.path),
        "messages": recovery.messages,
        "skipped": recovery.skipped,
        "seconds": duration,
    }
    print(f"{recovery.path}: {sum(recovery.messages.values())} messages over {duration:.1f} s.")
    if recovery.skipped:
        print(f"Not copied, because no log of tautscope has them: {', '.join(recovery.skipped)}.")
    if not recovery.damage:
        print(f"{file} was complete.")
    _print_damage(options, document, recovery.damage)


def _export(options: argparse.Namespace) -> None:
    from tautscope.log.export import export_csv, export_rosbag  # noqa: PLC0415

    file: Path = options.file
    document: dict[str, Any]
    if options.rosbag is not None:
        recovery = export_rosbag(file, options.rosbag)
        damage = recovery.damage
        document = {"folder": str(options.rosbag), "messages": recovery.messages}
        print(f"{options.rosbag}: {sum(recovery.messages.values())} messages.")
    elif options.rerun is not None:
        require_extras("tautscope export --rerun", ["rerun"])
        from tautscope.log.rerun_export import export_rerun  # noqa: PLC0415

        log, images = export_rerun(file, options.rerun)
        damage = log.damage
        document = {"file": str(options.rerun), "images": images}
        print(f"{options.rerun}: {len(log.events)} ticks, updates and requests, {images} images.")
    else:
        folder = options.csv or _beside(file, "-csv")
        damage = export_csv(file, folder)
        document = {"folder": str(folder)}
        print(f"{folder}: trace.csv, frames.csv, recording.toml, config.toml.")
    _print_damage(options, document, damage)


def _beside(file: Path, end: str) -> Path:
    from tautscope.log.mcap_records import no_log  # noqa: PLC0415

    if not file.is_file():
        raise no_log(file)
    return file.with_name(f"{file.stem}{end}")


def _print_damage(options: argparse.Namespace, document: dict[str, Any], damage: Damage) -> None:
    print_json(options, {**document, "damage": _damage(damage)})
    if damage:
        print(f"{options.file} is {'truncated' if damage.is_truncated else 'damaged'}: {damage}.")


def _damage(damage: Damage) -> dict[str, int]:
    return {"lost_bytes": damage.lost_bytes, "bad_chunks": damage.bad_chunks}


def _replay(options: argparse.Namespace) -> int:
    positions.check_video_options(options)
    if options.video is not None:
        return _estimate_from_video(options)
    from tautscope.log.reader import read_log  # noqa: PLC0415

    log = read_log(options.file)
    if options.config is None and options.profile in (None, log.config.profile):
        return _replay_same(options, log)
    return _estimate_from_log(options, log)


def _replay_same(options: argparse.Namespace, log: Log) -> int:
    from tautscope.log.replay import replay_same  # noqa: PLC0415

    if options.out is not None:
        check_free(options.out)
    comparison, replayed = replay_same(log)
    if options.out is not None:
        write_replay(options.out, replayed, log.recording())
    folder = None if options.out is None else str(options.out)
    identical = comparison.is_identical
    document = {"folder": folder, "identical": identical, **asdict(comparison)}
    print_json(options, {**document, **_facts(log)})
    print(
        f"{comparison.same_ticks} of {comparison.ticks} commands and "
        f"{comparison.same_updates} of {comparison.updates} updates identical, bit for bit."
    )
    if comparison.first_difference:
        print(f"First difference: {comparison.first_difference}.")
        if log.config.recording.image_format != "png":
            print("The images of this log are not lossless, so differences are expected.")
    if comparison.ended:
        print(f"The comparison ended early: {comparison.ended}.")
    _print_warnings(log)
    return 0 if comparison.is_identical else 1


def _estimate_from_log(options: argparse.Namespace, log: Log) -> int:
    from tautscope.commands.estimate_report import write_estimates  # noqa: PLC0415
    from tautscope.log.replay import estimate_from_log  # noqa: PLC0415

    if options.config is None:
        config = log.config.replace(profile=options.profile)
    else:
        config = load_config(options.config, options.profile)
    folder = arguments.out_folder(options)
    replayed, skipped = estimate_from_log(log, config)
    facts = {**_facts(log), "skipped": skipped}
    write_estimates(options, folder, replayed, log.recording(), facts)
    if skipped:
        print_warnings([f"{skipped} updates were skipped: their images are not in the log"])
    _print_warnings(log)
    return 0


def _estimate_from_video(options: argparse.Namespace) -> int:
    from tautscope.commands.estimate_report import write_estimates  # noqa: PLC0415
    from tautscope.log.alignment import implausible_motors  # noqa: PLC0415
    from tautscope.log.replay import estimate_from_video, retimed  # noqa: PLC0415

    config: Config = arguments.article_config(options.config, options.profile)
    folder = arguments.out_folder(options)
    motors = positions.read_positions(options.motors, options.units, config)
    found, stamps = positions.align_video_options(options, config, motors)
    for note in implausible_motors(found):
        _LOG.warning("%s", note)
    start = float(stamps[0]) - (found.delay if found.is_known else 0.0)
    frames = read_video(options.video, config.camera, float(stamps[0]))
    if options.video_start is None:
        if not found.is_known:
            allowed = (
                "the time of the video's first frame in the motors' [s], because it could not "
                f"be estimated ({found.reason}). If both began together, type --video-start "
                f"{stamps[0]:g}"
            )
            raise FieldError("--video-start", None, allowed)
        frames = retimed(frames, found)
    elif not found.is_known:
        _LOG.warning("--video-start was not checked: %s", found.reason)
    elif abs(found.delay) > max(TOLERANCE, 3 * found.delay_std):
        _LOG.warning(
            "with --video-start %g the images are %.2f s %s, which is estimated as slack; "
            "type --video-start %.3f, or leave it out",
            options.video_start,
            abs(found.delay),
            "late" if found.delay > 0 else "early",
            start,
        )
    with progress_bar("estimation") as progress:
        replayed = estimate_from_video(frames, *motors, config, progress)
    used = start if options.video_start is None else options.video_start
    facts = {"video_start": used, "delay": found.to_json()}
    write_estimates(options, folder, replayed, None, facts)
    images, times = replayed.frames["captured_at"], replayed.trace["time"]
    how = "estimated" if options.video_start is None else "given"
    print(
        f"The video begins at {used:.3f} s of the motor positions ({how}); images cover "
        f"{images[0]:.2f} to {images[-1]:.2f} s of their {times[0]:.2f} to {times[-1]:.2f} s."
    )
    return 0


def _facts(log: Log) -> dict[str, Any]:
    """What the object of ``--json`` says of a log."""
    return {"damage": _damage(log.damage), "warnings": list(log.warnings)}


def _print_warnings(log: Log) -> None:
    if log.damage:
        print_warnings(["the log is damaged; repair it with `tautscope recover`"])
    print_warnings(f"in the log: {warning}" for warning in log.warnings)
