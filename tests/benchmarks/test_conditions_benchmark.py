"""The benchmark of image conditions counts as it is defined."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from conditions import backgrounds, first_sight
from conditions.frames import Evaluation, Job, evaluate
from conditions.rows import table, to_rows, wrong_accepted

STATE = np.array([22e-3, 0.3, 0.9])


def test_rows_count_as_defined() -> None:
    names = ("clean", "debris", "no instrument")
    frames = [
        each
        for name in names
        for each in evaluate(Job(name, seed=0, background="procedural", frames=4))
    ]
    assert len(frames) == 12
    rows = to_rows(frames)
    assert {row["profile"] for row in rows} == {*names, "all"}
    for row in rows:
        is_reached = (
            row["pooled"] <= row["goal"] if row["sense"] == "max" else row["pooled"] >= row["goal"]
        )
        assert row["holds"] == is_reached
    errors = [each.error[0] for each in frames if each.condition == "clean" and each.valid[0]]
    rms = next(
        row["pooled"]
        for row in rows
        if row["profile"] == "clean" and row["what"] == "marker error, with prediction"
    )
    assert rms == pytest.approx(np.sqrt(np.mean(np.square(errors))))
    shown = table(rows)
    for name in names:
        held = all(row["holds"] for row in rows if row["profile"] == name)
        assert (f"| {name} |" in shown) != held
        assert (name in shown.partition("Every goal is held with ")[2]) == held
    assert "| all |" in shown
    # A detection without an instrument is wrong.
    wrong = Evaluation(
        "no instrument", 0, "procedural", 0, STATE, 0.0, (True, False), (np.full(2, np.inf),) * 2
    )
    assert wrong.is_wrong(0) and not wrong.is_wrong(1)
    assert wrong_accepted([wrong], 0) == 100


def test_clean_sequences_are_found_within_five_images() -> None:
    job = Job("clean", seed=0, background="procedural", frames=3)
    sequences = first_sight.evaluate(job)
    assert len(sequences) == 3
    for is_found, is_wrong, longest in sequences:
        assert is_found and not is_wrong and longest > 0


@pytest.mark.parametrize("name", ["__main__", "first_sight"])
def test_missing_frames_are_said_at_the_start(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign = importlib.import_module(f"conditions.{name}")
    monkeypatch.setattr(backgrounds, "FRAMES", tmp_path / "colon_frames")
    monkeypatch.setattr(campaign, "run_parallel", lambda *_: pytest.fail("measured"))
    monkeypatch.setattr(sys, "argv", ["conditions"])
    with pytest.raises(SystemExit):
        campaign.main()
    assert "Set TAUTSCOPE_DATA" in capsys.readouterr().err
