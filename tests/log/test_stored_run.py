"""Stored runs, and `tautscope report`; the recording in memory is the oracle."""

import json
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from drawn import DrawnRig, with_periods
from numpy.typing import ArrayLike
from tautscope.cli import main
from tautscope.config import Config
from tautscope.errors import MissingPathError, RecordError
from tautscope.log.stored_run import read_run
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Sample
from tautscope.report.recorded_run import RecordedRun
from tautscope.report.report import report_time
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording

Recorded = tuple[Path, Recording, LogSummary]
Capture = pytest.CaptureFixture[str]


class StoppedRig(DrawnRig):
    """A rig of which Ctrl-C ends the run, before the first degree of freedom is done."""

    STOP = 1.5

    def step(self, command: ArrayLike) -> Sample:
        sample = super().step(command)
        if sample.time > self.STOP:
            raise KeyboardInterrupt
        return sample


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory, config: Config) -> tuple[Path, RecordedRun]:
    """A run folder with both logs, and its recordings."""
    folder = tmp_path_factory.mktemp("pair")
    config = with_periods(config, 2.5)
    reference = SineSequence(config.experiment)
    found = []
    for name, compensate in (("uncompensated", False), ("compensated", True)):
        with LogWriter(
            folder / f"{name}.mcap",
            config,
            compensate=compensate,
            segments=reference.segments,
            wait=True,
        ) as log:
            found.append(run_experiment(DrawnRig(config), reference, config, compensate, log=log))
    return folder, RecordedRun(found[1], found[0])


def test_a_run_folder_gives_the_figures_of_the_run(
    pair: tuple[Path, RecordedRun], tmp_path: Path
) -> None:
    folder, run = pair
    stored = read_run(folder)
    assert stored.source == folder / "compensated.mcap"
    assert stored.results == run.results
    apart = read_run(folder / "compensated.mcap", folder / "uncompensated.mcap")
    assert apart.to_json() == run.to_json()
    assert read_run(folder / "compensated.mcap").results == run.results
    copied = shutil.copy(folder / "compensated.mcap", tmp_path / "other.mcap")
    alone = read_run(copied).results
    assert all(np.isnan(each.reduction) for each in alone.values())


def test_tables_give_the_figures_of_the_run(pair: tuple[Path, RecordedRun], tmp_path: Path) -> None:
    _, run = pair
    assert run.uncompensated is not None
    run.main.write(tmp_path)
    run.uncompensated.write(tmp_path, "_uncompensated")
    stored = read_run(tmp_path)
    assert stored.results == run.results
    assert "do not have its warnings" in stored.main.warnings[0]


def test_report_of_a_run_folder(
    capsys: Capture, pair: tuple[Path, RecordedRun], tmp_path: Path
) -> None:
    folder, run = pair
    out = tmp_path / "report"
    assert main(["report", str(folder), "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["folder"] == str(out)
    assert document["ticks"] == len(run.main.trace)
    assert document["dof"] == run.to_json()
    names = {"report.html", "fig9.png", "fig5.png", "table1.csv"}
    assert {path.name for path in out.iterdir()} == names
    page = (out / "report.html").read_text()
    assert "Of the true tip" in page
    began = read_run(folder).main.began
    assert began is not None and abs(datetime.now(UTC) - began) < timedelta(hours=1)
    assert f"<dt>began</dt><dd>{report_time(began)}</dd>" in page
    assert "http" not in page.replace("http-equiv", "")
    assert main(["report", str(folder), "--out", str(tmp_path / "second")]) == 0
    assert "reduction" in capsys.readouterr().out


def test_a_truncated_log_gives_the_part_that_it_has(
    capsys: Capture, pair: tuple[Path, RecordedRun], tmp_path: Path
) -> None:
    folder, run = pair
    whole = (folder / "compensated.mcap").read_bytes()
    file = tmp_path / "truncated.mcap"
    file.write_bytes(whole[: 6 * len(whole) // 10])
    assert main(["report", str(file), "--out", str(tmp_path / "out")]) == 0
    assert "warning: truncated.mcap is damaged or truncated" in capsys.readouterr().err
    stored = read_run(file).main
    count = len(stored.trace)
    assert 100 < count < len(run.main.trace)
    lasted = stored.trace["time"][-1] - stored.trace["time"][0]
    assert stored.segments == tuple(each for each in run.main.segments if each.end <= lasted)
    # A file that ends within its first chunk has no run.
    file.write_bytes(whole[:1000])
    with pytest.raises(RecordError, match=r"truncated.mcap: no messages at the start"):
        read_run(file)


def test_report_of_a_run_without_compensation(
    capsys: Capture, pair: tuple[Path, RecordedRun], tmp_path: Path
) -> None:
    folder, both = pair
    log = folder / "uncompensated.mcap"
    assert main(["report", str(log), "--out", str(tmp_path / "whole"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["is_compensated"] is False
    for label, figures in both.to_json().items():
        assert document["dof"][label]["uncompensated"] == figures["uncompensated"]
        assert document["dof"][label]["compensated"] is None
        assert document["dof"][label]["reduction"] is None
    page = (tmp_path / "whole" / "report.html").read_text()
    assert "uncompensated width" in page
    assert "<td>compensated width" not in page


def test_report_of_a_run_without_compensation_that_was_stopped(
    capsys: Capture, pair: tuple[Path, RecordedRun], tmp_path: Path
) -> None:
    _, both = pair
    assert both.uncompensated is not None
    # `run --compare` that is stopped before the run with compensation leaves this folder.
    stopped = tmp_path / "stopped"
    config = both.main.config
    reference = SineSequence(config.experiment)
    log = LogWriter(
        stopped / "uncompensated.mcap",
        config,
        compensate=False,
        segments=reference.segments,
        wait=True,
    )
    with pytest.raises(KeyboardInterrupt), log:
        run_experiment(StoppedRig(config), reference, config, False, log=log)
    assert main(["report", str(stopped), "--out", str(tmp_path / "out")]) == 0
    output = capsys.readouterr().out
    stored = read_run(stopped)
    assert not stored.main.segments
    count = len(stored.main.trace)
    assert 0.9 * StoppedRig.STOP < count * config.control.period < 1.1 * StoppedRig.STOP
    for name in stored.main.trace.dtype.names or ():
        whole = both.uncompensated.trace[name]
        np.testing.assert_array_equal(stored.main.trace[name], whole[:count], err_msg=name)
    # The tip is true and the run short: its second half counts.
    time, tip, reference = (
        stored.main.trace[name] for name in ("time", "true_insertion", "reference_insertion")
    )
    counts = time >= (time[0] + time[-1]) / 2
    rms = 1e3 * np.sqrt(np.mean((tip - reference)[counts] ** 2))
    expected = f"insertion: without compensation tracking error {rms:.3g} mm RMS, of the true tip"
    assert expected in output
    assert "largest error" not in (tmp_path / "out" / "report.html").read_text()
    # Where motion is held, the tables are beside the log; without the log they are enough.
    stored.main.write(stopped, "_uncompensated")
    assert read_run(stopped).source == stopped / "uncompensated.mcap"
    (stopped / "uncompensated.mcap").unlink()
    assert read_run(stopped).to_json() == stored.to_json()


def test_what_is_no_run_is_named(
    capsys: Capture, pair: tuple[Path, RecordedRun], recorded: Recorded, tmp_path: Path
) -> None:
    folder, _ = pair
    with pytest.raises(MissingPathError, match=r"recording\.toml"):
        read_run(tmp_path)
    with pytest.raises(RecordError, match="a run with compensation; without --uncompensated"):
        read_run(folder / "uncompensated.mcap", folder / "uncompensated.mcap")
    with pytest.raises(RecordError, match="a run without compensation"):
        read_run(folder / "compensated.mcap", folder / "compensated.mcap")
    for name in ("a", "b"):
        (tmp_path / f"{name}.mcap").write_bytes(recorded[0].read_bytes())
    with pytest.raises(RecordError, match="one of these logs"):
        read_run(tmp_path)
    assert main(["report", str(tmp_path / "none")]) == 2
    assert "File not found" in (error := capsys.readouterr().err)
    assert "or a folder with a log" in error


def test_both_runs_have_the_same_reference(
    pair: tuple[Path, RecordedRun], config: Config, tmp_path: Path
) -> None:
    folder, _ = pair
    periods = config.experiment.periods + 1
    other = with_periods(config, 2.5).replace(**{"experiment.periods": periods})
    reference = SineSequence(other.experiment)
    reference.duration = 2.5 * periods
    with LogWriter(
        tmp_path / "other.mcap",
        other,
        compensate=False,
        segments=reference.segments,
        wait=True,
    ) as log:
        run_experiment(DrawnRig(other), reference, other, False, log=log)
    with pytest.raises(RecordError, match="a run of the same reference"):
        read_run(folder / "compensated.mcap", tmp_path / "other.mcap")
