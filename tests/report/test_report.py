"""Report: self-contained page, rows and goals."""

import base64
import importlib
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from common.paths import ROOT
from matplotlib.figure import Figure
from tautscope.dof import Dof
from tautscope.report import figures, tables
from tautscope.report.demo import Demo, demo_report
from tautscope.report.operator_motion import OPERATOR_ROWS, OperatorResult
from tautscope.report.report import table1_section
from tautscope.report.results import ROWS, evaluate
from tautscope.report.rows import ARTICLE
from tautscope.report.tables import article_cell, cell
from tautscope.runs.recording import Recording

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Tags, links and text of a page; every tag must be closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def demo(runs: tuple[Recording, Recording]) -> Demo:
    uncompensated, compensated = runs
    result = evaluate(uncompensated, compensated)
    config = compensated.config.replace(**{"twin.background": "<b>&"})
    figures = {dof: OperatorResult(3e-3, 1e-3, 0.66, 1.8e-3, 1.5, 1e-4, 0.9, 8e-3) for dof in Dof}
    worse = {dof: replace(each, reduction=0.5, overspeed=4.4) for dof, each in figures.items()}
    return Demo(
        config,
        seeds=(3, 4),
        by_profile={"paper": (result, result)},
        uncompensated=uncompensated,
        compensated=compensated,
        article=None,
        operator_results=(figures, worse),
        operator_uncompensated=uncompensated,
        operator_compensated=replace(compensated, warnings=("tremor at 1 of 2 images",)),
        sim_seconds=144.0,
        wall_seconds=12.0,
    )


def test_the_report_is_self_contained(demo: Demo) -> None:
    figure = Figure(figsize=(2, 1)), "A <figure> of nothing."
    page_text = demo_report(demo, [figure], b"GIF")
    page = Page(page_text)
    assert page.open == []
    assert {"script", "link", "iframe"}.isdisjoint(page.tags)
    (film, image) = page.links
    assert film == "data:image/gif;base64,R0lG"
    assert image.startswith("data:image/jpeg;base64,")
    assert base64.b64decode(image.partition(",")[2]).startswith(b"\xff\xd8\xff")
    assert not re.search(r"url\(|@import|https?:", page_text)


def test_the_report_contains_the_results(demo: Demo) -> None:
    page = Page(demo_report(demo, [], b""))
    for row in ROWS:
        assert row.title in page.text
    result = demo.results[0][Dof.INSERTION]
    assert cell(ROWS[0], Dof.INSERTION, result.uncompensated) in page.text
    assert 'background = "<b>&"' in page.text  # escaped, so it reads as it is
    assert "not a medical device" in " ".join(page.text.split())
    assert "3, 4" in page.text
    assert "nan" not in page.text


def test_the_report_has_the_operator_motion(demo: Demo) -> None:
    text = demo_report(demo, [], b"")
    for row in OPERATOR_ROWS:
        assert f"<td>{row.title}</td>" in text
    assert text.count("<td>58 %<small>(50 %)</small></td>") == len(Dof)
    assert text.count("<td>2.95<small>(4.4)</small></td>") == len(Dof)
    assert "<td>3<small>(3)</small></td>" in text  # mm
    assert "operator motion: tremor at 1 of 2 images" in text


def test_the_report_has_a_column_for_each_profile_that_was_run(demo: Demo) -> None:
    worse = tuple(
        {dof: replace(result, reduction=0.123) for dof, result in each.items()}
        for each in demo.results
    )
    profiles = {"paper": worse, "best": demo.results}
    both = replace(
        demo, config=demo.config.replace(profile="best"), seeds=(3, 4, 5), by_profile=profiles
    )
    text = demo_report(both, [], b"")
    assert text.count("<th>paper</th><th>best</th>") == len(Dof)
    assert text.count("<td>12 %<small>(12 %)</small></td>") == len(Dof)
    assert "in 15 runs" in text  # of three seeds: three of the article, two of the operator
    assert "<th>best</th>" not in demo_report(demo, [], b"")
    assert "in 8 runs" in demo_report(demo, [], b"")


def test_the_report_of_one_run_without_a_true_state(runs: tuple[Recording, Recording]) -> None:
    """Only the rows measured by the camera are left."""
    recording = runs[1]
    blind = replace(recording, trace=recording.trace.copy(), frames=recording.frames.copy())
    for dof in Dof:
        blind.trace[f"true_{dof.label}"] = blind.frames[f"true_{dof.label}"] = np.nan
    results = evaluate(None, blind)
    page = table1_section(results)
    for title in ("compensated width, by camera", "tracking error, RMS, by camera", "frames used"):
        assert f"<td>{title}</td>" in page
    for title in ("reduction", "state error, RMS", "uncompensated width, by camera"):
        assert f"<td>{title}</td>" not in page
    assert "nan" not in page.lower()
    axis = figures.figure9(None, blind).axes[4]
    assert axis.get_xlabel() == "u [rad]"
    both = table1_section(evaluate(runs[0], blind))
    assert "<td>reduction, by camera</td>" in both
    assert '<td class="first">78 %</td>' in both  # the article's rotation


def test_tracking_error_by_camera_agrees_with_the_true_one(
    runs: tuple[Recording, Recording],
) -> None:
    """The estimate on the drawn rig is accurate."""
    for dof, found in evaluate(None, runs[1]).items():
        assert found.tracking_estimate == pytest.approx(found.tracking_rms, rel=0.2), dof
        assert np.isnan(found.uncompensated) and np.isnan(found.reduction_estimate)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("uncompensated", 10.04e-3, "10"),
        ("uncompensated", 2.513e-3, "2.51"),
        ("state_rms", 0.2345e-3, "0.23"),
        ("reduction", 0.754, "75 %"),
        ("start_periods", 1.5, "1.5"),
        ("marker_rms_px", 0.71, "0.71"),
        ("marker_rms_px", float("nan"), "-"),
    ],
)
def test_figures_are_rounded(name: str, value: float, text: str) -> None:
    row = next(row for row in ROWS if row.name == name)
    assert cell(row, Dof.INSERTION, value) == text


def test_the_articles_values_are_those_of_its_table() -> None:
    columns = [[article_cell(row, dof) for row in ROWS if row.name in ARTICLE] for dof in Dof]
    assert columns == [["10", "2.5", "75 %"], ["1.8", "0.4", "78 %"], ["1.1", "0.3", "73 %"]]


def test_every_row_is_explained_and_a_missed_goal_is_named(demo: Demo) -> None:
    best = {
        dof: replace(each, reduction=0.9796, tip_overspeed=2.0 + 1e-12, reduction_max=0.92)
        for dof, each in demo.results[0].items()
    }
    best[Dof.ROTATION] = replace(best[Dof.ROTATION], reduction=0.9596)
    of_best = {"config": demo.config.replace(profile="best"), "by_profile": {"best": (best, best)}}
    text = demo_report(replace(demo, **of_best), [], b"")
    page = Page(text)
    for row in (*ROWS, *OPERATOR_ROWS):
        assert row.meaning in page.text
    assert "<b>missed: insertion 98.0 %, rotation 96.0 %</b>" in text
    assert "<td>at most 2</td><td>holds</td>" in text
    assert "<td>at least 92 %, 88 %, 87 %</td><td>holds</td>" in text
    assert "<td>at most 1.8 mm, 0.38 rad, 0.24 rad</td><td>holds</td>" in text
    assert "missed" not in demo_report(demo, [], b""), "the goals are not those of profile paper"


def test_the_goals_are_those_of_the_benchmark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    goals = importlib.import_module("hysteresis.goals").GOALS
    names = {
        "reduction": "reduction of mean width",
        "reduction_max": "reduction of max width",
        "start_periods": "start",
        "tip_overspeed": "tip overspeed",
        "actuator_gain": "actuator gain",
    }
    operator_names = {
        "reduction": "operator: reduction of tracking error",
        "largest": "operator: largest error",
        "overspeed": "operator: tip overspeed",
        "creep": "operator: creep",
    }
    for rows, found in ((ROWS, names), (OPERATOR_ROWS, operator_names)):
        assert {row.name for row in rows if row.goal is not None} == set(found)
        for row in rows:
            for dof in Dof:
                if (limit := row.limit(dof)) is not None:
                    goal = goals[found[row.name]]
                    assert tables.in_display_unit(row, dof, limit) == pytest.approx(goal.limit(dof))
                    assert row.worst == goal.sense


def test_an_unknown_figure_is_null_in_json(demo: Demo) -> None:
    unknown = {
        dof: replace(result, tracking_rms=float("nan")) for dof, result in demo.results[0].items()
    }
    figures = {
        dof: replace(result, creep=float("nan")) for dof, result in demo.operator_results[0].items()
    }
    changed = {"by_profile": {"paper": (unknown,)}, "operator_results": (figures,)}
    found = replace(demo, **changed).to_json()
    assert found["profile"] == "paper"
    assert found["hand"]["bending"]["creep"] is None
    assert found["hand"]["insertion"]["largest"] == 1.8e-3  # in m, the rest of the object in mm
    assert found["dof"]["rotation"]["tracking_rms"] is None
    assert found["dof"]["rotation"]["worst"]["tracking_rms"] is None
    assert found["dof"]["insertion"]["unit"] == "mm"
    inside = unknown[Dof.INSERTION].compensated
    assert found["dof"]["insertion"]["compensated"] == pytest.approx(1e3 * inside)
