"""What all campaigns share: Ctrl-C, and the pages that `--write` updates."""

import importlib
import json
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, ClassVar

import pytest
from axes import sensor_faults
from common import doc_pages, processes
from common.processes import Results, run_until_stopped
from records import compensator, honest, loop, verdicts

CAMPAIGNS = {
    "soak.__main__": ["--plant", "plays"],
    "instruments.__main__": ["--features", "--instruments", "2"],
    "instruments.rivals": ["--instruments", "2"],
    "calibration.__main__": ["--write", "nominal"],
    "faults.__main__": [],
}


class Finished(dict[str, Any]):
    """Stands for the result of any campaign."""

    errors: ClassVar[dict[str, float]] = {}
    is_plausible, warnings = True, ()


def stopped_after(count: int) -> Callable[..., Iterator[tuple[Any, Any]]]:
    """`run_parallel` until Ctrl-C, which comes after some results."""

    def run(function: object, jobs: Any, *_: object) -> Iterator[tuple[Any, Any]]:
        yield from [(job, Finished()) for job in reversed(list(jobs)[:count])]
        raise KeyboardInterrupt

    return run


def test_a_stopped_campaign_returns_what_is_finished_in_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    options = Namespace(workers=1, scheduler=None)
    monkeypatch.setattr(processes, "run_parallel", stopped_after(2))
    found = run_until_stopped(abs, [3, 1, 2], options, "")
    assert list(found) == [3, 1]
    with pytest.raises(SystemExit, match="2 of 3 runs"):
        found.require_all()
    monkeypatch.setattr(processes, "run_parallel", stopped_after(0))
    with pytest.raises(SystemExit, match="before any"):
        run_until_stopped(abs, [3, 1, 2], options, "")
    Results({1: 2}).require_all()


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_stopped_campaign_updates_no_page(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign = importlib.import_module(name)
    written: list[object] = []
    monkeypatch.setattr(campaign, "insert", lambda *given: written.append(given))
    for shown in ("table", "report", "seed_rows", "results", "alarm_table", "seed_table"):
        monkeypatch.setattr(campaign, shown, lambda *_: "-", raising=False)
    monkeypatch.setattr(processes, "run_parallel", stopped_after(2))
    writes = [] if "--write" in CAMPAIGNS[name] else ["--write"]
    monkeypatch.setattr(sys, "argv", [name, *CAMPAIGNS[name], *writes])
    with pytest.raises(SystemExit, match="Stopped after 2 of"):
        campaign.main()
    assert not written


SELECTIONS = {
    "instruments.__main__": ["--seed 3", "--motion sines", "--features --variant best"],
    "instruments.rivals": ["--latency 0.02", "--loss 0.5", "--tune"],
    "axes.__main__": ["--dofs 1"],
    "faults.__main__": ["--kind outlier", "--seed 1", "--shard 1/2", "--off merged"],
    "calibration.__main__": ["--write nominla", "--write nominal --images"],
}
"""Options with which `--write` would lose rows of a page, or has no section."""


@pytest.mark.parametrize(("name", "selection"), [(n, s) for n in SELECTIONS for s in SELECTIONS[n]])
def test_a_selection_is_refused_before_anything_is_measured(
    name: str, selection: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign = importlib.import_module(name)
    monkeypatch.setattr(processes, "run_parallel", lambda *_: pytest.fail("measured"))
    for module in (campaign, importlib.import_module("faults.campaign")):
        monkeypatch.setattr(module, "run_parallel", processes.run_parallel, raising=False)
    writes = [] if "--write" in selection else ["--write"]
    monkeypatch.setattr(sys, "argv", [name, *selection.split(), *writes])
    with pytest.raises(SystemExit):
        campaign.main()
    assert "error: --write" in capsys.readouterr().err


def test_a_page_is_replaced_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "page.md"
    before = "a\n<!-- t: begin -->\nold\n<!-- t: end -->\nb\n"
    page.write_text(before, encoding="utf-8")
    doc_pages.insert(page, "t", r"new \1")
    after = page.read_text(encoding="utf-8")
    assert after == before.replace("old", r"new \1")
    write = Path.write_text

    def fail(path: Path, text: str, **given: Any) -> int:
        write(path, text[:10], **given)
        raise OSError("no space left")

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises(OSError, match="no space"):
        doc_pages.insert(page, "t", "newer")
    assert page.read_text(encoding="utf-8") == after
    assert list(tmp_path.iterdir()) == [page]


AS_JSON = {
    "axes.__main__": ["--colonoscope --seeds 1", "--start --first-seed 3", "--faults"],
    "records.__main__": ["--only honest", "--only verdicts", "--only compensator"],
}
OUTCOMES = {
    "--start": [1.0, 2.0, 3.0],
    "--faults": sensor_faults.Outcome(0.1, 0.2),
    "--colonoscope": [0.9, 0.8, 0.7],
    "--only honest": honest.Outcome(4.0, (4.0, 3.9, 4.1), "slack"),
    "--only verdicts": verdicts.Answer("slack", "4 mm", "text"),
    "--only compensator": [compensator.Reduction("half", 0.8, 0.7)],
}


@pytest.mark.parametrize(("name", "given"), [(n, given) for n in AS_JSON for given in AS_JSON[n]])
def test_json_has_the_outcome_of_every_job(
    name: str, given: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign = importlib.import_module(name)
    (outcome,) = (each for key, each in OUTCOMES.items() if given.startswith(key))
    ran: list[object] = []

    def run(function: object, jobs: Any, *_: object) -> Iterator[tuple[Any, Any]]:
        ran.extend(jobs)
        return ((job, outcome) for job in ran)

    monkeypatch.setattr(campaign, "run_parallel", run)
    monkeypatch.setattr(loop, "records", lambda: ["tool"])
    monkeypatch.setattr(verdicts, "names", lambda: ["tool"])
    monkeypatch.setattr(sys, "argv", [name, *given.split(), "--json"])
    campaign.main()
    printed = json.loads(capsys.readouterr().out)["outcomes"]
    if name.startswith("records"):
        printed = printed[given.rsplit(maxsplit=1)[-1]]
    assert len(printed) == len(ran) > 0
    plain = json.loads(json.dumps(outcome, default=asdict))
    assert all(each["outcome"] == plain for each in printed)


def test_what_has_no_rows_is_not_for_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign = importlib.import_module("records.__main__")
    monkeypatch.setattr(sys, "argv", ["records", "--only", "episodes", "--json"])
    monkeypatch.setattr(campaign.lerobot, "measure", lambda: pytest.fail("measured"))
    with pytest.raises(SystemExit):
        campaign.main()
    assert "--json has no rows" in capsys.readouterr().err
