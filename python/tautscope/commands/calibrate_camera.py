"""The command ``tautscope calibrate camera``."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments, calibration_output, calibration_rig
from tautscope.commands.board_images import file_images, live_images, twin_images
from tautscope.commands.printing import print_json
from tautscope.errors import FieldError
from tautscope.runs.output_folder import check_free_file, new_file

_MODELS = ("pinhole", "fisheye")


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    camera = arguments.add_verb(
        kinds,
        "camera",
        _run,
        help="intrinsics of the camera, with a ChArUco board",
        description="Calibrate the camera with a ChArUco board, from images, a video, the live "
        "camera of --config, or a ROS camera_info file; print the section [camera]. Live and in a "
        "video, hold the board still in each pose; the program says what to show next, and ends "
        "when the views suffice.",
        extras=["hardware"],
    )
    camera.add_argument(
        "files",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="images, one video, or one camera_info.yaml [the camera of --config]",
    )
    camera.add_argument(
        "--board", type=Path, metavar="FILE.pdf", help="only write the board, to print on A4"
    )
    add_board_options(camera)
    camera.add_argument(
        "--ros", type=Path, metavar="FILE", help="also write a ROS camera_info file"
    )
    calibration_rig.add_twin(camera, "show a simulated board to the twin's camera")
    calibration_output.add_options(camera)


def add_board_options(parser: argparse.ArgumentParser) -> None:
    """The board, the lens model, and the time limit of the live camera."""
    for name, direction, count in (("--columns", "side by side", 9), ("--rows", "in a column", 7)):
        parser.add_argument(
            name,
            type=arguments.positive,
            default=count,
            metavar="N",
            help=f"squares of the board {direction} [%(default)s]",
        )
    parser.add_argument(
        "--square",
        type=arguments.above_zero,
        default=4e-3,
        metavar="M",
        help="side of a square, measured on the print [%(default)s m]",
    )
    parser.add_argument(
        "--model", choices=_MODELS, default="pinhole", help="lens model of OpenCV [%(default)s]"
    )
    parser.add_argument(
        "--seconds",
        type=arguments.above_zero,
        default=180.0,
        metavar="S",
        help="time limit of the live camera [%(default)s]",
    )


def _run(options: argparse.Namespace) -> None:
    if options.board is not None:
        from tautscope.calibration.camera.board import Board  # noqa: PLC0415

        if options.files:
            raise FieldError("--board", str(options.board), "no files beside it")
        of_images = ("model", "seconds", "ros", "twin", "seed", "config", "write", "out")
        arguments.refuse_unused(options, "no --board, which calibrates nothing", *of_images)
        board = Board(options.columns, options.rows, options.square)
        with new_file(options.board) as partial:
            board.write_pdf(partial)
        print_json(options, {"file": str(options.board)})
        print(f"Print {options.board} at 100 %, and measure its ruler and squares.")
        return
    is_imported = len(options.files) == 1 and options.files[0].suffix in (".yaml", ".yml")
    if is_imported:
        arguments.refuse_unused(options, "images of a board", "columns", "rows", "square", "model")
    if options.files or options.twin:
        arguments.refuse_unused(options, "the live camera, whose time limit it is", "seconds")
    calibration_rig.check_options(options, is_motion=not options.files)
    calibration_output.check_options(options, reads_config=not options.files)
    if options.ros is not None:
        check_free_file(options.ros)
    if is_imported:
        result, info = _import(options.files[0])
    else:
        result, info = calibrate(options, options.files)
    calibration_output.finish(options, result)
    if options.ros is not None:  # what is printed already is not lost by an error
        with new_file(options.ros) as partial:
            partial.write_text(info, encoding="utf-8")


def calibrate(
    options: argparse.Namespace, files: Sequence[Path] = ()
) -> tuple[CalibrationResult, str]:
    """The result, and the text of a ROS camera_info file.

    Views of the board are collected until they suffice, or the images end. Files are images or a
    video, in place of the camera of the rig or the twin.
    """
    from tautscope.calibration.camera.board import Board  # noqa: PLC0415
    from tautscope.calibration.camera.camera_info import camera_info  # noqa: PLC0415
    from tautscope.calibration.camera.coverage import ViewCollector  # noqa: PLC0415
    from tautscope.calibration.camera.intrinsics import fit_intrinsics  # noqa: PLC0415
    from tautscope.calibration.camera.result import camera_result  # noqa: PLC0415

    board = Board(options.columns, options.rows, options.square)
    config = None if files else arguments.article_config(options.config)
    if config is None:
        images = file_images(files)
    elif options.twin:
        images = twin_images(calibration_rig.twin_config(options, config), board)
        images = replace(images, serial_numbers=calibration_rig.twin_device(options, config))
    elif options.config is None:
        raise FieldError("files", None, "images, a video, --config FILE of a rig, or --twin")
    else:
        images = live_images(config, options.seconds)
    collector = ViewCollector(board, images.size, is_stream=images.is_stream)
    try:
        for image in images.images:
            if collector.offer(image):
                print(collector.status(), file=sys.stderr, flush=True)
            if images.is_live and collector.coverage.is_complete:
                break
    finally:
        images.images.close()
    collector.check()
    fit = fit_intrinsics(collector.views, images.size, options.model)
    result = camera_result(fit, collector.coverage, images.serial_numbers)
    return result, camera_info(fit.intrinsics)


def _import(file: Path) -> tuple[CalibrationResult, str]:
    """As `calibrate`, of a ROS camera_info file."""
    from tautscope.calibration.camera.camera_info import (  # noqa: PLC0415
        camera_info,
        read_camera_info,
    )
    from tautscope.calibration.camera.result import camera_values  # noqa: PLC0415

    camera = read_camera_info(file)
    values, notes = camera_values(camera)
    result = CalibrationResult("camera", values, notes=(f"from {file}", *notes))
    return result, camera_info(camera)
