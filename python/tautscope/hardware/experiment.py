"""The article's experiment on the drives and the camera of a configuration."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import DriveError, OutputError, TautscopeError
from tautscope.hardware.plausibility import Plausibility
from tautscope.hardware.realtime import (
    OTHERS,
    VISION,
    little_collection,
    memory_kept,
    realtime,
    settle,
)
from tautscope.hardware.rig import HardwareRig
from tautscope.hardware.signals import exit_on_signals
from tautscope.hardware.timing import Timing
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.loop.reduction import Report
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import Reaction, Supervision
from tautscope.report.results import Results, evaluate
from tautscope.report.tables import finite_or_none
from tautscope.runs.experiment import run_experiment
from tautscope.runs.output_folder import check_free
from tautscope.runs.recording import Floats, Recording, Table

RigMaker = Callable[[Config], HardwareRig]


@dataclass(frozen=True)
class Part:
    """One run of the protocol.

    Attributes:
        recording: What the loop did.
        timing: How punctual it was.
        log: What is in its log.
    """

    recording: Recording
    timing: Timing
    log: LogSummary


@dataclass(frozen=True)
class HardwareRun:
    """What ``tautscope run`` found.

    Attributes:
        config: As used.
        compensated: The run.
        uncompensated: The one before it, without compensation, if it was asked for.
    """

    config: Config
    compensated: Part
    uncompensated: Part | None = None

    @property
    def results(self) -> Results:
        """Table 1 as the camera sees it; half of it NaN without an uncompensated run."""
        plain = None if self.uncompensated is None else self.uncompensated.recording
        return evaluate(plain, self.compensated.recording)

    def to_json(self) -> dict[str, Any]:
        """What ``tautscope run --json`` prints; widths in m or rad, None if not known."""
        parts = {"compensated": self.compensated}
        if self.uncompensated is not None:
            parts = {"uncompensated": self.uncompensated, **parts}
        return {
            "profile": self.config.profile,
            "runs": {name: _facts(part) for name, part in parts.items()},
            "by_camera": {
                dof.label: {
                    "uncompensated": finite_or_none(found.uncompensated_estimate),
                    "compensated": finite_or_none(found.compensated_estimate),
                    "reduction": finite_or_none(found.reduction_estimate),
                    "tracking_rms": finite_or_none(found.tracking_estimate),
                }
                for dof, found in self.results.items()
            },
        }


def run_on_hardware(
    config: Config,
    folder: Path,
    progress: Callable[[float], None],
    *,
    compare: bool = False,
    make_rig: RigMaker = HardwareRig,
) -> HardwareRun:
    """The article's protocol on the hardware of a configuration, with a log of every run.

    However it ends, the motors have been brought to quick stop and the log is closed. SIGTERM and
    SIGHUP end it like Ctrl-C.

    Args:
        config: With a section ``drives``.
        folder: New or empty; the log is there from the first moment on.
        progress: Told the share of the work done, 0 to 1.
        compare: Run without compensation first, so that there is a reduction.
        make_rig: Makes the rig.

    Raises:
        ConfigError: The rig cannot be as configured; `Plausibility` says what was seen.
        TautscopeError: What drives, camera or loop raised.
    """
    kinds = (False, True) if compare else (True,)
    rig = make_rig(config)  # a configuration that cannot work leaves no folder
    _make(check_free(folder))
    parts = []
    with exit_on_signals(), little_collection(), memory_kept(), realtime(OTHERS):
        for index, compensate in enumerate(kinds):
            parts.append(
                _run(
                    rig,
                    config,
                    folder / ("compensated.mcap" if compensate else "uncompensated.mcap"),
                    compensate,
                    lambda share, done=index: progress((done + share) / len(kinds)),  # type: ignore[misc]
                )
            )
    return HardwareRun(config, parts[-1], parts[0] if compare else None)


def write_run_folder(run: HardwareRun, folder: Path) -> None:
    """Tables, timing, figures and report, beside the logs that are there."""
    from tautscope.hardware.timing_figure import timing_figure  # noqa: PLC0415  matplotlib
    from tautscope.report import figures, report, tables  # noqa: PLC0415  matplotlib takes half a second

    first, results = run.compensated, run.results
    first.recording.write(folder)
    picture = timing_figure(first.timing)
    plain = None if run.uncompensated is None else run.uncompensated.recording
    loops = figures.figure9(plain, first.recording)
    pictures = [
        report.CaptionedFigure(
            loops,
            "Fig. 9. (a)-(c) with compensation: reference, command, estimate and both contact "
            "offsets. (d)-(f) loops of the estimate; the first period, in which the slack is "
            "learnt, is thin. The dashed line is a perfect tip.",
        ),
        report.CaptionedFigure(
            picture,
            "How punctual the run was. (a), (b) how much later than due each set-point was sent; "
            "(c), (d) from capture until the loop was given the frame.",
        ),
    ]
    if run.uncompensated is not None:
        run.uncompensated.recording.write(folder, "_uncompensated")
        run.uncompensated.timing.write(folder, "_uncompensated")
    tables.write_csv(folder / "table1.csv", [run.config.twin.seed], {run.config.profile: [results]})
    facts = {
        "control": f"{1 / first.timing.cycle:g} Hz, {first.timing.lost} cycles lost",
        "log": first.log.path.name,
    }
    with figures.style():
        picture.savefig(folder / "timing.png")
        loops.savefig(folder / "fig9.png")
        page = report.run_report(run.config, facts, results, pictures, first.recording.warnings)
    (folder / "report.html").write_text(page, encoding="utf-8")
    (folder / "run.json").write_text(json.dumps(run.to_json(), indent=1), encoding="utf-8")
    first.timing.write(folder)


def _run(
    rig: HardwareRig,
    config: Config,
    path: Path,
    compensate: bool,
    progress: Callable[[float], None],
) -> Part:
    reference = SineSequence(config.experiment)
    with LogWriter(path, config, compensate=compensate, segments=reference.segments) as log:

        def say(text: str) -> None:
            print(f"warning: {text}", file=sys.stderr, flush=True)
            log.warn(text)

        rig.say = say
        eyes = ThreadPoolExecutor(1, "vision", settle, (VISION,))
        try:
            recording = run_experiment(
                rig,
                reference,
                config,
                compensate,
                lambda elapsed, duration: progress(min(elapsed / duration, 1.0)),
                log=_Watched(log, config),
                executor=eyes,
                watch=lambda standing: _obey(rig, standing),
            )
        except BaseException as error:
            log.warn(f"{type(error).__name__}: {error}")
            error.add_note(f"The log up to then is {path}")
            raise
        finally:
            rig.close()
            eyes.shutdown()
    progress(1.0)
    return Part(recording, rig.timing, log.close())


def _obey(rig: HardwareRig, standing: Supervision) -> None:
    """Do with the drives what the loop's guards say, in the tick in which they say it."""
    reaction = standing.reaction
    if reaction.rank < Reaction.QUICK_STOP.rank:
        return
    disables = reaction is Reaction.DISABLE
    stop = DriveError(
        "loop",
        f"{reaction} ({', '.join(standing.flags)})",
        f"The motors are {'without power' if disables else 'stopped'}. See docs/safety.md for "
        "what was noticed, and the log for what led to it",
    )
    try:
        rig.disable() if disables else rig.close()
    except TautscopeError as failed:
        stop.add_note(str(failed))
    raise stop


class _Watched:
    """A log, and a watch that the tip goes where the motors go."""

    def __init__(self, log: LogWriter, config: Config) -> None:
        self._log = log
        self._config = config
        self._watch: Plausibility | None = None

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        self._log.tick(sample, reference, command, made_at)
        if self._watch is None:
            self._watch = Plausibility(self._config, sample.applied)
        self._watch.tick(sample.time, sample.applied)

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        self._log.frame(now, frame, report)
        if self._watch is not None:
            self._watch.frame(frame.captured_at, report)

    def event(self, now: float, what: str) -> None:
        self._log.event(now, what)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError("out", str(folder), f"a place that can be written ({error})") from None


def _facts(part: Part) -> dict[str, Any]:
    frames = part.recording.frames
    return {
        "log": str(part.log.path),
        "log_complete": part.log.is_complete,
        "ticks": len(part.recording.trace),
        "status": dict(Counter(frames["status"].tolist())),
        "observable": _shares(frames),
        "timing": part.timing.summary(),
        "warnings": list(part.recording.warnings),
    }


def _shares(frames: Table) -> dict[str, float | None]:
    return {
        dof.label: finite_or_none(float(frames[f"observable_{dof.label}"].mean()))
        if len(frames)
        else None
        for dof in Dof
    }
