"""The article's experiment on a physical rig: ``tautscope run``."""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import STOPPED, DriveError, OutputError, TautscopeError
from tautscope.hardware.plausibility import PlausibilityMonitor
from tautscope.hardware.realtime import OTHERS, VISION, realtime_executor, realtime_process
from tautscope.hardware.rig import HardwareRig
from tautscope.hardware.signals import exit_on_signals
from tautscope.hardware.timing import Timing
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.loop.reduction import Report
from tautscope.loop.references import Reference, SineSequence
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import Reaction, Supervision
from tautscope.report.operator_motion import OperatorResults, evaluate_operator_motion
from tautscope.report.results import Results, evaluate
from tautscope.report.tables import finite_or_none, operator_to_json
from tautscope.runs.experiment import run_experiment
from tautscope.runs.output_folder import check_free
from tautscope.runs.recording import Floats, Recording, Table

RigMaker = Callable[[Config], HardwareRig]
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProtocolRun:
    """One run of the protocol.

    Attributes:
        recording: Traces of the loop.
        timing: Timing of set-points and frames.
        log: Summary of its log.
    """

    recording: Recording
    timing: Timing
    log: LogSummary


@dataclass(frozen=True)
class HardwareRun:
    """Results of ``tautscope run``.

    Attributes:
        config: The configuration used.
        compensated: The run with compensation.
        uncompensated: The run without compensation, if it was requested.
    """

    config: Config
    compensated: ProtocolRun
    uncompensated: ProtocolRun | None = None

    @property
    def results(self) -> Results:
        """Table 1 from the state estimates; NaN where it needs an uncompensated run.

        Empty for a recorded motion.
        """
        return evaluate(self._plain, self.compensated.recording)

    @property
    def operator_results(self) -> OperatorResults:
        """Tracking of a recorded motion by the state estimates; empty for the experiment."""
        recording = self.compensated.recording
        return {} if recording.segments else evaluate_operator_motion(self._plain, recording)

    @property
    def _plain(self) -> Recording | None:
        return None if self.uncompensated is None else self.uncompensated.recording

    def to_json(self) -> dict[str, Any]:
        """The output of ``tautscope run --json``; widths in m or rad, None if unknown."""
        runs = {"compensated": self.compensated}
        if self.uncompensated is not None:
            runs = {"uncompensated": self.uncompensated, **runs}
        return {
            "profile": self.config.profile,
            "runs": {name: _summary(run) for name, run in runs.items()},
            "by_camera": {
                dof.label: {
                    "uncompensated": finite_or_none(found.uncompensated_estimate),
                    "compensated": finite_or_none(found.compensated_estimate),
                    "reduction": finite_or_none(found.reduction_estimate),
                    "tracking_rms": finite_or_none(found.tracking_estimate),
                }
                for dof, found in self.results.items()
            }
            | operator_to_json(self.operator_results),
        }


def run_on_hardware(
    config: Config,
    folder: Path,
    progress: Callable[[float], None],
    reference: Reference | None = None,
    *,
    compare: bool = False,
    make_rig: RigMaker = HardwareRig,
) -> HardwareRun:
    """Run a reference on the configured drives and camera, and log every run.

    The motors are quick-stopped and the log is closed on every exit, also after SIGTERM and SIGHUP.
    A run that is refused before the loop begins leaves no log and no folder.

    Args:
        config: With a section ``drives``.
        folder: New or empty; the log is written there from the start.
        progress: Called with the fraction of the work done, 0 to 1.
        reference: By default the article's protocol.
        compare: Run without compensation first, to compute the reduction.
        make_rig: Makes the rig.

    Raises:
        ConfigError: The rig differs from its configuration; see `PlausibilityMonitor`.
        TautscopeError: Drives, camera or loop failed.
    """
    kinds = (False, True) if compare else (True,)
    rig = make_rig(config)  # an invalid configuration must leave no folder behind
    _make_folder(check_free(folder))
    runs = []
    with exit_on_signals(), realtime_process(OTHERS):
        for index, compensate in enumerate(kinds):
            runs.append(
                _run(
                    rig,
                    config,
                    reference or SineSequence(config.experiment),
                    folder / ("compensated.mcap" if compensate else "uncompensated.mcap"),
                    compensate=compensate,
                    progress=lambda fraction, done=index: progress((done + fraction) / len(kinds)),  # type: ignore[misc]
                )
            )
    return HardwareRun(config, runs[-1], runs[0] if compare else None)


def write_run_folder(run: HardwareRun, folder: Path) -> None:
    """Write tables, timing, figures and report into the folder of the logs."""
    from tautscope.figure_style import style  # noqa: PLC0415
    from tautscope.hardware.timing_figure import timing_figure  # noqa: PLC0415  matplotlib
    from tautscope.report import figures, report, tables  # noqa: PLC0415  matplotlib takes half a second
    from tautscope.report.operator_figure import draw_operator_motion  # noqa: PLC0415

    first, results = run.compensated, run.results
    first.recording.write(folder)
    picture = timing_figure(first.timing)
    plain = None if run.uncompensated is None else run.uncompensated.recording
    if first.recording.segments:
        name, section = "fig9.png", report.table1_section(results)
        main = report.CaptionedFigure(
            figures.figure9(plain, first.recording),
            "Fig. 9. (a)-(c) with compensation: reference, command, estimate and both contact "
            "offsets. (d)-(f) loops of the estimate; a narrow loop on the dashed line, an ideal "
            "tip, is the goal. The first period, in which the slack is estimated, is thin.",
        )
    else:
        name, section = "tracking.png", report.recorded_motion_section(run.operator_results)
        main = report.CaptionedFigure(
            draw_operator_motion(plain, first.recording),
            "The recorded motion. (a)-(c) reference, command and the tip as the camera measures "
            "it, in a part of the run. (d)-(f) tracking error over the whole run.",
        )
    pictures = [
        main,
        report.CaptionedFigure(
            picture,
            "Timing of the run. (a), (b) delay of each set-point after its due time; "
            "(c), (d) age of each frame when the loop took it.",
        ),
    ]
    if run.uncompensated is not None:
        run.uncompensated.recording.write(folder, "_uncompensated")
        run.uncompensated.timing.write(folder, "_uncompensated")
    if results:
        tables.write_csv(
            folder / "table1.csv", [run.config.twin.seed], {run.config.profile: [results]}
        )
    facts = {
        "control": f"{1 / first.timing.cycle:g} Hz, {first.timing.lost} cycles lost",
        "log": first.log.path.name,
    }
    with style():
        picture.savefig(folder / "timing.png")
        main.figure.savefig(folder / name)
        page = report.run_report(
            run.config,
            facts,
            section,
            pictures,
            first.recording.warnings,
        )
    (folder / "report.html").write_text(page, encoding="utf-8")
    (folder / "run.json").write_text(json.dumps(run.to_json(), indent=1), encoding="utf-8")
    first.timing.write(folder)


def _run(
    rig: HardwareRig,
    config: Config,
    reference: Reference,
    path: Path,
    *,
    compensate: bool,
    progress: Callable[[float], None],
) -> ProtocolRun:
    with LogWriter(path, config, compensate=compensate, segments=reference.segments) as log:

        def warn(text: str) -> None:
            _LOG.warning("%s", text)
            log.warn(text)

        rig.warn = warn
        executor = realtime_executor("vision", VISION)
        monitored = _MonitoredLog(log, config)
        try:
            recording = run_experiment(
                rig,
                reference,
                config,
                compensate,
                lambda elapsed, duration: progress(min(elapsed / duration, 1.0)),
                log=monitored,
                executor=executor,
                watch=lambda supervision: _apply_reaction(rig, supervision),
            )
        except BaseException as error:
            log.warn(f"{type(error).__name__}: {error}")
            if monitored.has_begun:
                error.add_note(f"The log of the run is {path}")
                if isinstance(error, TautscopeError):
                    error.exit_status = STOPPED
            else:  # nothing to keep: the same folder can be used again
                log.close()
                path.unlink()
                with suppress(OSError):
                    path.parent.rmdir()
            raise
        finally:
            rig.close()
            executor.shutdown()
    progress(1.0)
    return ProtocolRun(recording, rig.timing, log.close())


def _apply_reaction(rig: HardwareRig, supervision: Supervision) -> None:
    """Apply the supervisor's reaction to the drives, in the tick in which it is decided.

    Raises:
        DriveError: The reaction is a quick stop or disable.
    """
    reaction = supervision.reaction
    if reaction.rank < Reaction.QUICK_STOP.rank:
        return
    is_disabled = reaction is Reaction.DISABLE
    stop = DriveError(
        "loop",
        f"{reaction} ({', '.join(supervision.flags)})",
        f"The motors are {'without power' if is_disabled else 'stopped'}. docs/safety.md explains "
        "the flags; the log shows the cause",
    )
    try:
        rig.disable() if is_disabled else rig.close()
    except TautscopeError as error:
        stop.add_note(str(error))
    raise stop


class _MonitoredLog:
    """Writes the log and checks the plausibility of every sample and frame."""

    def __init__(self, log: LogWriter, config: Config) -> None:
        self._log = log
        self._config = config
        self._monitor: PlausibilityMonitor | None = None

    @property
    def has_begun(self) -> bool:
        """Whether the loop has commanded the motors."""
        return self._monitor is not None

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        self._log.tick(sample, reference, command, made_at)
        if self._monitor is None:
            self._monitor = PlausibilityMonitor(self._config, sample.applied)
        self._monitor.add_sample(sample.time, sample.applied)

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        self._log.frame(now, frame, report)
        if self._monitor is not None:
            self._monitor.check_frame(frame.captured_at, report)

    def event(self, now: float, what: str) -> None:
        self._log.event(now, what)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError("out", str(folder), f"a place that can be written ({error})") from None


def _summary(run: ProtocolRun) -> dict[str, Any]:
    frames = run.recording.frames
    return {
        "log": str(run.log.path),
        "log_complete": run.log.is_complete,
        "ticks": len(run.recording.trace),
        "status": dict(Counter(frames["status"].tolist())),
        "observable": _observable_fractions(frames),
        "timing": run.timing.summary(),
        "warnings": list(run.recording.warnings),
    }


def _observable_fractions(frames: Table) -> dict[str, float | None]:
    return {
        dof.label: finite_or_none(float(frames[f"observable_{dof.label}"].mean()))
        if len(frames)
        else None
        for dof in Dof
    }
