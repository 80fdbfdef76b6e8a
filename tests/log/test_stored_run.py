"""Stored runs, and `tautscope report`; the recording in memory is the oracle."""

import json
from pathlib import Path

import numpy as np
import pytest
from drawn import DrawnRig
from tautscope.cli import main
from tautscope.config import Config
from tautscope.errors import MissingPathError, RecordError
from tautscope.log.stored_run import read_run
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.loop.references import SineSequence
from tautscope.report.recorded_run import RecordedRun
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording

Recorded = tuple[Path, Recording, LogSummary]
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory, config: Config) -> tuple[Path, RecordedRun]:
    """A run folder with both logs, and its recordings."""
    folder = tmp_path_factory.mktemp("pair")
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


def test_a_run_folder_gives_the_figures_of_the_run(pair: tuple[Path, RecordedRun]) -> None:
    folder, run = pair
    stored = read_run(folder)
    assert stored.source == folder / "compensated.mcap"
    assert stored.run.results == run.results
    apart = read_run(folder / "compensated.mcap", folder / "uncompensated.mcap")
    assert apart.run.to_json() == run.to_json()
    alone = read_run(folder / "compensated.mcap").run.results
    assert all(np.isnan(each.reduction) for each in alone.values())


def test_tables_give_the_figures_of_the_run(pair: tuple[Path, RecordedRun], tmp_path: Path) -> None:
    _, run = pair
    assert run.uncompensated is not None
    run.compensated.write(tmp_path)
    run.uncompensated.write(tmp_path, "_uncompensated")
    stored = read_run(tmp_path).run
    assert stored.results == run.results
    assert "do not have its warnings" in stored.compensated.warnings[0]


def test_report_of_a_run_folder(
    capsys: Capture, pair: tuple[Path, RecordedRun], tmp_path: Path
) -> None:
    folder, run = pair
    out = tmp_path / "report"
    assert main(["report", str(folder), "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["folder"] == str(out)
    assert document["ticks"] == len(run.compensated.trace)
    assert document["dof"] == run.to_json()
    names = {"report.html", "fig9.png", "fig5.png", "table1.csv"}
    assert {path.name for path in out.iterdir()} == names
    page = (out / "report.html").read_text()
    assert "Of the true tip" in page
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
    output = capsys.readouterr().out
    assert "truncated.mcap is damaged or truncated" in output
    stored = read_run(file).run.compensated
    count = len(stored.trace)
    assert 100 < count < len(run.compensated.trace)
    lasted = stored.trace["time"][-1] - stored.trace["time"][0]
    assert stored.segments == tuple(each for each in run.compensated.segments if each.end <= lasted)
    # A file that ends within its first tick has no run.
    file.write_bytes(whole[: len(whole) // 100])
    with pytest.raises(RecordError):
        read_run(file)


def test_what_is_no_run_is_named(
    capsys: Capture, pair: tuple[Path, RecordedRun], recorded: Recorded, tmp_path: Path
) -> None:
    folder, _ = pair
    with pytest.raises(MissingPathError, match=r"recording\.toml"):
        read_run(tmp_path)
    with pytest.raises(RecordError, match="a run with compensation; this one had none"):
        read_run(folder / "uncompensated.mcap")
    with pytest.raises(RecordError, match="a run without compensation"):
        read_run(folder / "compensated.mcap", folder / "compensated.mcap")
    for name in ("a", "b"):
        (tmp_path / f"{name}.mcap").write_bytes(recorded[0].read_bytes())
    with pytest.raises(RecordError, match="one of these logs"):
        read_run(tmp_path)
    assert main(["report", str(tmp_path / "none.mcap")]) == 2
    assert "none.mcap" in capsys.readouterr().err


def test_both_runs_have_the_same_reference(
    pair: tuple[Path, RecordedRun], config: Config, tmp_path: Path
) -> None:
    folder, _ = pair
    other = config.replace(**{"experiment.periods": config.experiment.periods + 1})
    reference = SineSequence(other.experiment)
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
