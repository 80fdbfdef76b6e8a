"""``tautscope recover``, ``export`` and ``replay``."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautscope.commands import arguments
from tautscope.commands.printing import console, print_json
from tautscope.config import Config, load_config
from tautscope.errors import FieldError

if TYPE_CHECKING:
    from tautscope.log.comparison import Estimation
    from tautscope.log.reader import Damage, Log
    from tautscope.runs.recording import Recording


def add_parsers(verbs: arguments.Verbs) -> None:
    """Add the verbs to the command's."""
    recover = verbs.add_parser(
        "recover",
        allow_abbrev=False,
        help="mend a log whose run ended before its time",
        description="Copy what can be read of a torn log into a new one that every reader opens. "
        "The old file is left as it is.",
    )
    recover.add_argument("file", type=Path, metavar="FILE.mcap")
    recover.add_argument(
        "--out", type=Path, metavar="FILE", help="new file [FILE-recovered.mcap beside it]"
    )
    recover.set_defaults(run=_recover)

    export = verbs.add_parser(
        "export",
        allow_abbrev=False,
        help="turn a log into CSV or a rosbag2 folder",
        description="Turn a log, whole or torn, into CSV (a line per tick, a line per image) or "
        "into a rosbag2 folder.",
    )
    export.add_argument("file", type=Path, metavar="FILE.mcap")
    kinds = export.add_mutually_exclusive_group(required=True)
    kinds.add_argument(
        "--csv",
        type=Path,
        nargs="?",
        const=Path(),
        metavar="DIR",
        help="folder, new or empty [FILE-csv beside it]",
    )
    kinds.add_argument("--rosbag", type=Path, metavar="DIR", help="folder, new or empty")
    export.set_defaults(run=_export)

    replay = verbs.add_parser(
        "replay",
        allow_abbrev=False,
        help="run a recorded log, or a video and motor positions, through the loop again",
        description="Run the inputs of a log through the loop again. With its own configuration "
        "every output must be the same, bit for bit (exit status 1 if not); with another one, "
        "print and draw what would have been estimated. The same from a plain video and a CSV of "
        "motor positions with columns time [s], insertion [m], rotation and bending [rad].",
    )
    replay.add_argument("file", type=Path, nargs="?", metavar="FILE.mcap")
    replay.add_argument("--video", metavar="FILE", help="video instead of a log; needs --motors")
    replay.add_argument("--motors", type=Path, metavar="FILE.csv", help="motor positions")
    replay.add_argument(
        "--video-start",
        type=arguments.seconds,
        default=0.0,
        metavar="S",
        help="time of the video's first frame in the CSV's [s] [%(default)s]",
    )
    arguments.add_config(replay)
    arguments.add_profile(replay, "how slack is learnt")
    arguments.add_out(replay, "replay")
    arguments.add_json(replay)
    replay.set_defaults(run=_replay)


def _recover(options: argparse.Namespace) -> None:
    from tautscope.log.export import recover  # noqa: PLC0415

    file: Path = options.file
    found = recover(file, options.out or file.with_name(f"{file.stem}-recovered.mcap"))
    span = (found.last - found.first) / 1e9
    print(f"{found.path}: {sum(found.messages.values())} messages over {span:.1f} s.")
    if not found.damage:
        print(f"{file} was whole.")
    _print_damage(file, found.damage)


def _export(options: argparse.Namespace) -> None:
    from tautscope.log.export import export_csv, export_rosbag  # noqa: PLC0415

    file: Path = options.file
    if options.rosbag is not None:
        found = export_rosbag(file, options.rosbag)
        print(f"{options.rosbag}: {sum(found.messages.values())} messages.")
        _print_damage(file, found.damage)
        return
    folder = options.csv if options.csv != Path() else file.with_name(f"{file.stem}-csv")
    damage = export_csv(file, folder)
    print(f"{folder}: trace.csv, frames.csv, recording.toml, config.toml.")
    _print_damage(file, damage)


def _print_damage(file: Path, damage: Damage) -> None:
    if damage.is_torn:
        print(f"{file} is torn: its last {damage.lost_bytes} bytes are no whole record.")
    if damage.bad_chunks:
        print(f"{file}: damaged chunks that were left out: {damage.bad_chunks}.")


def _replay(options: argparse.Namespace) -> int:
    if (options.file is None) == (options.video is None):
        came = "neither" if options.file is None else "both"
        raise FieldError("replay", came, "a log, or --video with --motors")
    if (options.video is None) != (options.motors is None):
        raise FieldError("--motors", options.motors, "a CSV file together with --video")
    if options.video is not None:
        return _replay_video(options)
    from tautscope.log.reader import read_log  # noqa: PLC0415

    log = read_log(options.file)
    if options.config is None and options.profile in (None, log.config.profile):
        return _replay_same(options, log)
    return _replay_other(options, log)


def _replay_same(options: argparse.Namespace, log: Log) -> int:
    from tautscope.log.comparison import write_replay  # noqa: PLC0415
    from tautscope.log.replay import replay_same  # noqa: PLC0415
    from tautscope.runs.output_folder import check_free  # noqa: PLC0415

    if options.out is not None:
        check_free(options.out)
    found, replayed = replay_same(log)
    if options.out is not None:
        write_replay(options.out, replayed, log.recording())
    if options.json:
        print_json(
            {
                "identical": found.is_identical,
                "ticks": found.ticks,
                "same_ticks": found.same_ticks,
                "updates": found.updates,
                "same_updates": found.same_updates,
                "first_difference": found.first_difference,
                "ended": found.ended,
            }
        )
    else:
        print(
            f"{found.same_ticks} of {found.ticks} commands and {found.same_updates} of "
            f"{found.updates} image updates identical, bit for bit."
        )
        if found.first_difference:
            print(f"First difference: {found.first_difference}.")
            if log.config.recording.image_format != "png":
                print("The log's images are not lossless, so this had to be.")
        if found.ended:
            print(f"Compared up to a hole: {found.ended}.")
        _print_troubles(log)
    return 0 if found.is_identical else 1


def _replay_other(options: argparse.Namespace, log: Log) -> int:
    from tautscope.log.replay import listen_to_log  # noqa: PLC0415

    if options.config is None:
        config = log.config.replace(profile=options.profile)
    else:
        config = load_config(options.config, options.profile)
    folder = _folder(options)
    heard = listen_to_log(log, config)
    _tell(options, folder, heard.recording, log.recording())
    if not options.json:
        if heard.skipped:
            print(f"{heard.skipped} image updates were left out: their images are not in the log.")
        _print_troubles(log)
    return 0


def _replay_video(options: argparse.Namespace) -> int:
    from tautscope.hardware.video import read_video  # noqa: PLC0415
    from tautscope.log.replay import listen_to_video  # noqa: PLC0415

    config: Config = load_config(options.config, options.profile)
    folder = _folder(options)
    frames = read_video(options.video, config.camera, options.video_start)
    heard = listen_to_video(frames, options.motors, config)
    _tell(options, folder, heard.recording, None)
    if not options.json:
        images, motors = heard.recording.frames["captured_at"], heard.recording.trace["time"]
        print(
            f"Images from {images[0]:.2f} to {images[-1]:.2f} s of the motors' "
            f"{motors[0]:.2f} to {motors[-1]:.2f} s; if that is not all of them, see --video-start."
        )
    return 0


def _folder(options: argparse.Namespace) -> Path:
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415

    return check_free(options.out or default_folder("replay"))


def _tell(
    options: argparse.Namespace, folder: Path, replayed: Recording, recorded: Recording | None
) -> None:
    from tautscope.log.comparison import estimations, write_replay  # noqa: PLC0415

    write_replay(folder, replayed, recorded)
    after = estimations(replayed, recorded)
    before = None if recorded is None else estimations(recorded)
    if options.json:
        document: dict[str, Any] = {"images": len(replayed.frames), "dof": {}}
        for dof, figures in after.items():
            entry = {"replayed": _finite(figures)}
            if before is not None:
                entry["recorded"] = _finite(before[dof])
            document["dof"][dof.label] = entry
        print_json(document)
        return
    _print_table(replayed, before, after)
    print(f"\nFigure and samples: {folder / 'replay.png'}")


def _print_table(
    replayed: Recording,
    before: dict[Any, Estimation] | None,
    after: dict[Any, Estimation],
) -> None:
    from rich.table import Table  # noqa: PLC0415

    table = Table(box=None, pad_edge=False, title_justify="left", title_style="bold")
    table.title = f"What the loop estimates from {len(replayed.frames)} images"
    table.add_column("", no_wrap=True)
    for dof in after:
        unit = f"{dof.label} [{dof.display_unit}]"
        if before is not None:
            table.add_column(f"{unit}\nrecorded", justify="right", style="dim", no_wrap=True)
        table.add_column("\nreplayed" if before else unit, justify="right", no_wrap=True)
    for title, name in (
        ("slack at the end", "width"),
        ("images that show the DOF", "seen"),
        ("estimate, RMS error", "state_rms"),
        ("estimate, RMS change", "change_rms"),
    ):
        cells = []
        for dof, figures in after.items():
            pair = [figures] if before is None else [before[dof], figures]
            cells += [_cell(getattr(each, name), name, dof.display_scale) for each in pair]
        if any(cells):
            table.add_row(title, *cells)
    console().print(table)


def _cell(value: float, name: str, scale: float) -> str:
    if math.isnan(value):
        return ""
    return f"{100 * value:.0f} %" if name == "seen" else f"{scale * value:.3g}"


def _finite(figures: Estimation) -> dict[str, float | None]:
    from tautscope.report.tables import finite_or_none  # noqa: PLC0415

    names = ("width", "seen", "state_rms", "change_rms")
    return {name: finite_or_none(getattr(figures, name)) for name in names}


def _print_troubles(log: Log) -> None:
    if log.damage:
        print("The log is damaged; `tautscope recover` makes it one that every reader opens.")
    for warning in log.warnings:
        print(f"The log warns: {warning}.")
