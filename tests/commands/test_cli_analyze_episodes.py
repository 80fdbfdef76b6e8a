"""`tautscope analyze` of a data set of LeRobot in the layout of OpenRC."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from records.lerobot import COLUMNS, MOTORS, TIP, WIDTHS, episode, write
from refused import failed
from tautscope.analysis import episodes as of_episodes
from tautscope.analysis.verdict import Verdict
from tautscope.cli import main
from tautscope.errors import ConfigError
from tautscope.runs.episodes import list_episodes, open_episode
from tautscope.runs.records import Record

FRAMES, EPISODES = 900, 3
ALL = (
    "--command", *(f"action.{motor}" for motor in MOTORS),
    "--measured", *(f"observation.state.tip_{end}" for end in ("x", "q_turn", "y")),
)  # fmt: skip


@pytest.fixture(scope="module", params=["v2.1", "v3.0"])
def data_set(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("sets") / request.param, request.param, EPISODES, FRAMES)


def analyzed(capsys: pytest.CaptureFixture[str], *options: object) -> dict[str, Any]:
    assert main(["analyze", *map(str, options), "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


def test_episodes_are_tables_with_the_names_of_the_features(data_set: Path) -> None:
    found = list_episodes(data_set)
    assert [each.number for each in found] == list(range(EPISODES))
    sheet = open_episode(data_set, found[2])
    motors, tip = episode(2, FRAMES)
    for k, name in enumerate(TIP):
        values = sheet.read([f"observation.state.{name}"]).columns.popitem()[1]
        np.testing.assert_allclose(values, tip[:, k], rtol=1e-6)
    np.testing.assert_allclose(
        sheet.read(["action.motor_3"]).columns.popitem()[1], motors[:, 2], rtol=1e-6
    )


def test_the_slack_of_all_degrees_of_freedom(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    data_set = write(tmp_path / "set", "v2.1", EPISODES, FRAMES)
    found = analyzed(capsys, data_set, *ALL, "--workers", 1, "--out", tmp_path / "out")
    assert found["episodes"] == EPISODES
    for dof, width in zip(found["dofs"], WIDTHS, strict=True):
        assert dof["identified"] >= EPISODES - 1
        assert dof["median"] == pytest.approx(width, rel=0.05)
        assert dof["tenth"] <= dof["median"] <= dof["ninetieth"]
    rows = pl.read_csv(tmp_path / "out" / "episodes.csv")
    assert len(rows) == 3 * EPISODES
    known = rows.filter(pl.col("identified"))
    assert (known["width_low"] < known["width"]).all()
    assert (tmp_path / "out" / "episodes.png").stat().st_size > 1000


def test_an_episode_that_cannot_be_judged_does_not_end_the_others(
    data_set: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the error, it is in the row."""

    def refuse(record: Record, columns: tuple[str, str]) -> Verdict:
        raise ConfigError("dof[0].speed", 49.8, "at most 10 m/s")

    monkeypatch.setattr(of_episodes, "judge", refuse)
    (found,) = list_episodes(data_set)[:1]
    pairs = {"tip": (COLUMNS[1], COLUMNS[3])}
    (row,) = of_episodes.judge_episode(str(data_set), pairs, None, (), found)
    assert not row["identified"]
    assert "dof[0].speed: got 49.8" in row["missing"]


def test_workers_do_not_change_the_result(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    data_set = write(tmp_path / "set", "v3.0", of_episodes.CHUNK + 1, 300)
    environment = dict(os.environ)
    one, two = (
        analyzed(capsys, data_set, *COLUMNS, "--workers", n, "--out", tmp_path / str(n))["dofs"]
        for n in (1, 2)
    )
    assert one == two
    files = [(tmp_path / n / "episodes.csv").read_text() for n in ("1", "2")]
    assert files[0] == files[1]
    assert dict(os.environ) == environment


@pytest.mark.usefixtures("undrawn", "three_models")
def test_columns_are_listed_and_one_episode_is_analysed(
    data_set: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    listed = analyzed(capsys, data_set)
    assert "observation.state.tip_q_turn [rad]" in [each["title"] for each in listed["columns"]]
    assert all(".motor_" in each["command"] for each in listed["pairs"])
    assert all(".tip_" in each["measured"] for each in listed["pairs"])
    found = analyzed(capsys, data_set, *COLUMNS, "--episode", 1, "--out", tmp_path / "out")
    assert found["dofs"][0]["width"] == pytest.approx(WIDTHS[0], rel=0.1)
    assert (tmp_path / "out" / "compensator.toml").exists()
    message = failed(capsys, "analyze", str(data_set), "--episode", "99")
    assert "--episode: got 99, expected one of 0 to 2" in message


def test_episodes_without_an_answer_are_counted_with_the_reason(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Too short ones, and one in which the motor stands."""
    folder = write(tmp_path / "set", "v2.1", 3, 60)
    still = pl.read_parquet(folder / "data/chunk-000/episode_000001.parquet")
    still = still.with_columns(action=pl.lit([1.0, 1.0, 1.0]))
    still.write_parquet(folder / "data/chunk-000/episode_000001.parquet")
    assert (
        main(["analyze", str(folder), *COLUMNS, "--workers", "1", "--out", str(tmp_path / "o")])
        == 0
    )
    text = capsys.readouterr().out
    assert "identified in 0 of 3 episodes. Not in 2, such as episode 0: the tip reverses" in text
    assert "Not in 1, such as episode 1: command: got '1 throughout the first half'" in text


def test_the_interval_of_the_median_holds_it_in_95_percent() -> None:
    rng = np.random.default_rng(0)
    for count in (6, 30, 101):
        held = 0
        for _ in range(2000):
            low, high = of_episodes._median_interval(np.sort(rng.exponential(size=count)))
            held += low <= np.log(2) <= high
        assert 0.945 < held / 2000 <= 1
    assert of_episodes._median_interval(np.arange(5.0)) == (None, None)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("info", 'info.json: got "JSONDecodeError'),
        ("file", "episode_000001.parquet: got '"),
        ("pointer", "episode_000001.parquet: got 'a pointer of Git LFS', expected the file itself"),
        ("none", "data: got 'no episode'"),
    ],
)
def test_damage_is_named(
    damage: str, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = write(tmp_path / "set", "v2.1", 2, 60)
    file = folder / "data/chunk-000/episode_000001.parquet"
    if damage == "info":
        (folder / "meta/info.json").write_text('{"features": {"action"')
    elif damage == "file":
        file.write_bytes(file.read_bytes()[:500])
    elif damage == "pointer":
        file.write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    else:
        for each in file.parent.iterdir():
            each.unlink()
    assert message in failed(capsys, "analyze", str(folder))


def test_options_that_do_not_belong_are_refused(
    data_set: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for option in (["--gain", "2"], ["--check"]):
        text = failed(capsys, "analyze", str(data_set), *COLUMNS, *option)
        assert text.startswith(f"error: {option[0]}: got ")
        assert "expected --episode" in text
    one = failed(capsys, "analyze", str(data_set), *COLUMNS, "--episode", "0", "--workers", "2")
    assert "--workers: got 2, expected no --episode" in one
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    with pytest.raises(SystemExit):
        main(["analyze", str(tmp_path / "a.csv"), *COLUMNS, "--workers", "2"])
    assert "--workers is for the folder of a data set" in capsys.readouterr().err


def test_a_file_with_several_episodes_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = write(tmp_path / "set", "v3.0", 2, 60)
    text = failed(capsys, "analyze", str(folder / "data/chunk-000/file-000.parquet"))
    assert "got '2 episodes', expected one: give the data set's folder" in text


def test_a_reason_counts_once_whatever_its_numbers() -> None:
    between = ("0 and 14.2", "1.3 and 14.2", "-1.3e-05 and 2", "3 and 1e+08")
    rows = [
        {"episode": k, "identified": False, "aligned": False, "missing": f"it is between {each}"}
        for k, each in enumerate(between)
    ]
    (reason,) = of_episodes.summarize(rows)["reasons"]
    assert reason["count"] == len(between)
