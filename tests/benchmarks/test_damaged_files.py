"""`analyze` of damaged files refuses them with a message; a small part of `benchmarks/damage`."""

import json
from pathlib import Path

import numpy as np
import pytest
from damage import trial
from damage.files import damage, signals, wild, write_seeds
from damage.trial import run, try_file


def test_damaged_files_are_refused_or_analysed() -> None:
    found = run(30, 3, None, whole=10**6)
    assert sum(counts["FAILED"] for counts in found.values()) == 0
    assert sum(counts["refused"] for counts in found.values()) > 5
    assert sum(counts["judged"] for counts in found.values()) > 1


def test_all_formats_have_a_pair_if_nothing_is_damaged(tmp_path: Path) -> None:
    for file in write_seeds(tmp_path, signals()):
        status, text = trial._command("analyze", file, "--json")
        assert status == 0, text
        assert json.loads(text)["pairs"], file.name


def test_an_error_of_any_other_kind_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ValueError("planted")

    monkeypatch.setattr(trial, "read_record", broken)
    file = next(each for each in write_seeds(tmp_path, signals()) if each.name == "plain.csv")
    outcome = try_file(file, is_whole=False)
    assert outcome.what == "FAILED"
    assert "ValueError: planted" in outcome.text


def test_a_seed_gives_the_same_damage(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_bytes(b"time,motor,tip\n" + b"1,2,3\n" * 50)
    copies = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        rng = np.random.default_rng(5)
        copies.append(damage(file, tmp_path / name, rng).read_bytes())
        columns = wild(rng)
    assert copies[0] == copies[1] != file.read_bytes()
    assert set(columns) == {"time", "motor", "tip"}
