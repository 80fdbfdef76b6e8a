"""A run as it is stored: a log, a run folder, or a folder of tables."""

from dataclasses import replace
from datetime import datetime
from os import PathLike
from pathlib import Path

import numpy as np

from tautscope.errors import MissingPathError, RecordError
from tautscope.log.reader import Log, Tick, Update, read_log
from tautscope.log.silence import Silence
from tautscope.loop.safety import Reaction, disabled_monitors
from tautscope.report.recorded_run import RecordedRun
from tautscope.runs.flag_summary import FlagSummary
from tautscope.runs.recording import Recording, Snapshot, per_dof, per_feature

KINDS = "a log (.mcap), or a folder with a log or with recording.toml"
"""What the path of a run may be."""
PLAIN = "_uncompensated"
"""Suffix of the tables of a run without compensation."""
LEAST_DURATION = 1.0
"""Of a run that is evaluated [s]."""
_DROPPED = "dropped"


def read_run(
    path: str | PathLike[str], uncompensated: str | PathLike[str] | None = None
) -> RecordedRun:
    """Read a run, and if it has compensation the one without beside it, if there is one.

    The recordings have their warnings. Of an experiment that ended early they have the segments
    that are complete; without one it counts as another motion.

    Args:
        path: A log, of which ``compensated.mcap`` is as its folder; a folder with
            ``compensated.mcap`` and perhaps ``uncompensated.mcap``, or with a single log; or a
            folder of `Recording.save` or `tautscope export`.
        uncompensated: Log or folder of the run without compensation, in place of the one beside it.

    Raises:
        MissingPathError: There is no run at a path.
        RecordError: It cannot be read, is shorter than 1 s, is not the run that is expected, or
            both runs do not have the same reference.
    """
    source, main, plain = _find(Path(path))
    if uncompensated is not None:
        if not main.compensated:
            raise RecordError(
                "run", str(path), "a run with compensation; without --uncompensated any run"
            )
        plain = _find(Path(uncompensated))[1]
        if plain.compensated:
            raise RecordError("--uncompensated", str(uncompensated), "a run without compensation")
    if plain is not None:
        _check_same_reference(plain, main, str(uncompensated or source))
    return RecordedRun(main, plain, source)


def _find(place: Path) -> tuple[Path, Recording, Recording | None]:
    """Where a run was found, the run, and the one without compensation beside it."""
    folder = place if place.is_dir() else place.parent
    pair = [folder / f"{name}compensated.mcap" for name in ("", "un")]
    if place in (folder, pair[0]) and pair[0].is_file():
        return pair[0], _from_log(pair[0]), _from_log(pair[1]) if pair[1].is_file() else None
    if place.is_dir():
        logs = sorted(place.glob("*.mcap"))
        kinds = [kind for kind in ("", PLAIN) if (place / f"recording{kind}.toml").is_file()]
        if "" in kinds or (kinds and not logs):
            tables = [_from_tables(place, kind) for kind in kinds]
            return place, tables[0], tables[1] if len(tables) > 1 else None
        if len(logs) > 1:
            raise RecordError("run", ", ".join(map(str, logs)), "one of these logs")
        if not logs:
            raise MissingPathError("run", str(place), KINDS)
        place = logs[0]
    elif not place.exists():
        raise MissingPathError("run", str(place), KINDS)
    return place, _from_log(place), None


def _from_tables(folder: Path, suffix: str = "") -> Recording:
    unknown = "the tables of a run do not have its warnings; a log has them"
    return _checked(replace(Recording.load(folder, suffix), warnings=(unknown,)), folder)


def _from_log(path: Path) -> Recording:
    log = read_log(path)
    recording = _checked(log.recording(), path)
    found = [*disabled_monitors(log.config), *_flags(log, recording), *log.warnings]
    if log.damage:
        found.append(f"{path.name} is damaged or truncated: {log.damage}")
    if log.missing:
        found.append(f"{log.missing} ticks or updates of the run are not in {path.name}")
    began = datetime.fromtimestamp(log.clock.epoch / 1e9).astimezone()
    return replace(
        recording, warnings=tuple(found), snapshot=_snapshot(log, recording), began=began
    )


def _updates(log: Log) -> list[tuple[int, Update]]:
    """Indices and updates, in the order of the recording's frames."""
    return [(index, each) for index, each in log.events.items() if isinstance(each, Update)]


def _flags(log: Log, recording: Recording) -> tuple[str, ...]:
    """A line for each flag that was in force at an update, or because none arrived."""
    summary, silence = FlagSummary(recording.config), Silence(recording.config)
    start = float(recording.trace["time"][0])
    flags, reaction, last = [""], Reaction.NONE, 0
    for index, event in log.events.items():
        if isinstance(event, Update):
            now, (_, values) = float(event.row["arrived_at"]), event.status
            flags, reaction = values["warnings"].split(","), Reaction(values["reaction"])
            silence.end(now, is_dropped=_DROPPED in flags)
            summary.add(now - start, flags, reaction)
        elif isinstance(event, Tick):
            now = event.sample.time
            if index > last + 1:  # an update may be missing in the log alone
                silence.end(now, is_dropped=_DROPPED in flags)
            found = silence.update(now, event.reference)
            is_known = found is Reaction.NONE or _DROPPED in flags
            names = flags if is_known else [*flags, _DROPPED]
            strongest = max(reaction, found, key=lambda each: each.rank)
            summary.add_tick(now - start, names, strongest)
        last = index
    return summary.lines()


def _checked(recording: Recording, path: Path) -> Recording:
    """The recording with its complete segments."""
    time = recording.trace["time"]
    lasted = float(time[-1] - time[0]) if len(time) else 0.0
    if lasted < LEAST_DURATION:
        raise RecordError("run", f"{path}: {lasted:.3g} s", f"at least {LEAST_DURATION:g} s")
    complete = tuple(
        segment for segment in recording.segments if segment.end <= lasted + 2 * lasted / len(time)
    )
    return replace(recording, segments=complete)


def _snapshot(log: Log, recording: Recording) -> Snapshot | None:
    """The image nearest to the middle of the run in which both bands were found, if any."""
    frames = recording.frames
    if log.config.dof:
        return None
    measured, predicted = (per_feature(frames, name) for name in ("features", "predicted_features"))
    has_bands = np.isfinite(measured).all(axis=1) & np.isfinite(predicted).all(axis=1)
    nearest = sorted(np.flatnonzero(has_bands), key=lambda k: abs(k - len(frames) / 2))
    indices = [index for index, _ in _updates(log)]
    for k in nearest if log.config.camera.pixel_format == "bgr" else ():
        if log.has_image(indices[k]):
            captured_at = float(frames["captured_at"][k])
            return Snapshot(log.image(indices[k]), captured_at, measured[k], predicted[k])
    return None


def _check_same_reference(plain: Recording, compensated: Recording, path: str) -> None:
    """The references agree to a hundredth of their range while both runs last."""
    dofs = compensated.config.dofs
    if plain.config.dofs != dofs:
        raise RecordError("--uncompensated", path, "a run of the same degrees of freedom")
    first, second = (per_dof(run.trace, "reference", dofs) for run in (plain, compensated))
    count = min(len(first), len(second))
    limit = 0.01 * np.ptp(second[:count], axis=0) + 1e-9
    if (np.abs(first[:count] - second[:count]).max(axis=0) > limit).any():
        raise RecordError("--uncompensated", path, "a run of the same reference")
