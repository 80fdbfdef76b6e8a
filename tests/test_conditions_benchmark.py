"""The benchmark of image conditions counts what it says."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import condition_frames as frames_of
import conditions

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

STATE = np.array([22e-3, 0.3, 0.9])


def test_the_benchmark_counts_what_it_says() -> None:
    names = ("clean", "debris", "no instrument")
    looks = [
        look
        for name in names
        for look in frames_of.judge(frames_of.Job(name, seed=0, real=False, frames=4))
    ]
    assert len(looks) == 12
    rows = conditions.to_rows(looks)
    assert {row["profile"] for row in rows} == {*names, "all"}
    for row in rows:
        good = (
            row["pooled"] <= row["goal"] if row["sense"] == "max" else row["pooled"] >= row["goal"]
        )
        assert row["holds"] == good
    errors = [k.error[0] for k in looks if k.condition == "clean" and k.valid[0]]
    rms = next(
        row["pooled"]
        for row in rows
        if row["profile"] == "clean" and row["what"] == "marker error, with prediction"
    )
    assert rms == pytest.approx(np.sqrt(np.mean(np.square(errors))))
    assert conditions.table(rows).count("\n") == 1 + len(names) + 1
    # Something reported where there is nothing is wrong, however near.
    wrong = frames_of.Look(
        "no instrument", 0, False, 0, STATE, 0.0, (True, False), (np.full(2, np.inf),) * 2
    )
    assert wrong.wrong(0) and not wrong.wrong(1)
    assert conditions.wrong_accepted([wrong], 0) == 100
