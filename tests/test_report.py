"""Report and figures: self-contained page, no global state."""

import base64
import importlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from tautscope.dof import Dof
from tautscope.figure_style import BLUE, ORANGE
from tautscope.report import figures, tables
from tautscope.report.demo import Demo, demo_report
from tautscope.report.operator_figure import draw_operator_motion
from tautscope.report.operator_motion import OperatorResult
from tautscope.report.report import CaptionedFigure, run_report, table1_section
from tautscope.report.results import DofResult, evaluate
from tautscope.report.rows import ARTICLE, OPERATOR_ROWS, ROWS
from tautscope.report.tables import article_cell, cell
from tautscope.runs.recording import Recording

ROOT = Path(__file__).resolve().parents[1]
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
def runs(uncompensated: Recording, compensated: Recording) -> tuple[Recording, Recording]:
    return uncompensated, compensated


@pytest.fixture(scope="module")
def demo(runs: tuple[Recording, Recording]) -> Demo:
    uncompensated, compensated = runs
    result = evaluate(uncompensated, compensated)
    config = compensated.config.replace(**{"twin.background": "<b>&"})
    figures = {dof: OperatorResult(3e-3, 1e-3, 0.66, 2e-3, 1.5, 1e-4, 0.9) for dof in Dof}
    worse = {dof: replace(each, reduction=0.5, overspeed=4.4) for dof, each in figures.items()}
    return Demo(
        config,
        seeds=(3, 4),
        results=(result, result),
        uncompensated=uncompensated,
        compensated=compensated,
        operator_results=(figures, worse),
        operator_uncompensated=uncompensated,
        operator_compensated=replace(compensated, warnings=("tremor at 1 of 2 images",)),
        sim_seconds=144.0,
        wall_seconds=12.0,
    )


def test_the_report_is_self_contained(demo: Demo) -> None:
    figure = CaptionedFigure(Figure(figsize=(2, 1)), "A <figure> of nothing.")
    page_text = demo_report(demo, [figure])
    page = Page(page_text)
    assert page.open == []
    assert {"script", "link", "iframe"}.isdisjoint(page.tags)
    assert all(link.startswith("data:image/jpeg;base64,") for link in page.links)
    assert len(page.links) == 1
    image = base64.b64decode(page.links[0].partition(",")[2])
    assert image.startswith(b"\xff\xd8\xff")
    assert not re.search(r"url\(|@import|https?:", page_text)


def test_the_report_contains_the_results(demo: Demo) -> None:
    page = Page(demo_report(demo, []))
    for row in ROWS:
        assert row.title in page.text
    result = demo.results[0][Dof.INSERTION]
    assert cell(ROWS[0], Dof.INSERTION, result.uncompensated) in page.text
    assert 'background = "<b>&"' in page.text  # escaped, so it reads as it is
    assert "not a medical device" in " ".join(page.text.split())
    assert "3, 4" in page.text
    assert "nan" not in page.text


def test_the_report_has_the_operator_motion(demo: Demo) -> None:
    text = demo_report(demo, [])
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
    both = replace(
        demo, config=demo.config.replace(profile="best"), seeds=(3, 4, 5), article_results=worse
    )
    text = demo_report(both, [])
    assert text.count("<th>paper</th><th>best</th>") == len(Dof)
    assert text.count("<td>12 %<small>(12 %)</small></td>") == len(Dof)
    assert "in 15 runs" in text  # of three seeds: three of the article, two of the operator
    assert "<th>best</th>" not in demo_report(demo, [])
    assert "in 8 runs" in demo_report(demo, [])


def test_the_report_of_one_run_without_a_true_state(runs: tuple[Recording, Recording]) -> None:
    """Only the rows measured by the camera are left."""
    recording = runs[1]
    blind = replace(recording, trace=recording.trace.copy(), frames=recording.frames.copy())
    for dof in Dof:
        blind.trace[f"true_{dof.label}"] = blind.frames[f"true_{dof.label}"] = np.nan
    results = evaluate(None, blind)
    page = run_report(
        blind.config, {}, table1_section(results), [], ["lost (nothing) at 1 of 2 images"]
    )
    for title in ("compensated width, by camera", "tracking error, RMS, by camera", "frames used"):
        assert f"<td>{title}</td>" in page
    for title in ("reduction", "state error, RMS", "uncompensated width, by camera"):
        assert f"<td>{title}</td>" not in page
    assert "lost (nothing) at 1 of 2 images" in page
    assert "nan" not in page.split("profile =")[0].lower()
    axis = figures.figure9(None, blind).axes[4]
    assert axis.get_xlabel() == "u [rad]"
    both = run_report(blind.config, {}, table1_section(evaluate(runs[0], blind)), [], [])
    assert "<td>reduction, by camera</td>" in both
    assert '<td class="first">78 %</td>' in both  # the article's rotation


def test_tracking_error_by_camera_agrees_with_the_true_one(
    runs: tuple[Recording, Recording],
) -> None:
    """The estimate on the drawn rig is accurate."""
    for dof, found in evaluate(None, runs[1]).items():
        assert found.tracking_estimate == pytest.approx(found.tracking_rms, rel=0.2), dof
        assert np.isnan(found.uncompensated) and np.isnan(found.reduction_estimate)


def test_figures_do_not_change_global_state(runs: tuple[Recording, Recording]) -> None:
    before = dict(matplotlib.rcParams)
    figure = figures.figure9(*runs)
    assert dict(matplotlib.rcParams) == before
    axes = figure.axes
    assert len(axes) == 6
    assert [axis.get_title(loc="left")[:3] for axis in axes] == [f"({k})" for k in "abcdef"]
    command = axes[0].lines[0]
    assert np.nanmax(command.get_ydata()) > 40  # mm, and beyond the reference's 40


def test_figure9_has_both_profiles_and_the_true_tip(runs: tuple[Recording, Recording]) -> None:
    """A shift of the true tip of one run shows in its own row and loop."""
    free, run = runs
    article = replace(
        run, config=run.config.replace(profile="paper"), trace=run.trace.copy()
    )  # another drawn run
    best = replace(run, config=run.config.replace(profile="best"))
    shift = 3e-3
    article.trace["true_insertion"] += shift
    axes = figures.figure9(free, best, article).axes
    assert [axis.get_title(loc="left")[:3] for axis in axes] == [f"({k})" for k in "abcdefghi"]
    titles = [axis.get_title(loc="left") for axis in axes[::3]]
    assert titles == [
        "(a) insertion, profile best",
        "(d) insertion, profile paper",
        "(g) insertion",
    ]
    ours, theirs = (
        next(line for line in axis.lines if line.get_label() == "true tip").get_ydata()
        for axis in (axes[0], axes[3])
    )
    np.testing.assert_allclose(theirs - ours, 1e3 * shift)
    loops = {line.get_color(): line.get_ydata() for line in axes[6].lines[::3][:3]}
    np.testing.assert_allclose(loops[ORANGE] - loops[BLUE], 1e3 * shift)
    unknown = replace(best, trace=best.trace.copy())
    unknown.trace["true_insertion"] = np.nan
    labels = [line.get_label() for line in figures.figure9(None, unknown).axes[0].lines]
    assert "true tip" not in labels and "estimate q̂" in labels


def test_the_uncompensated_loop_is_drawn_wider(runs: tuple[Recording, Recording]) -> None:
    axis = figures.figure9(*runs).axes[4]
    drawn = [np.ptp(line.get_xdata() - line.get_ydata()) for line in axis.lines[:6]]
    (before, _, _), (after, first, _) = drawn[:3], drawn[3:6]
    assert before > after > 0
    assert first > after, "the first period, before the offsets are estimated, is wider"


def test_a_loop_without_measurements_is_labelled(runs: tuple[Recording, Recording]) -> None:
    recording = replace(runs[1], frames=runs[1].frames.copy(), trace=runs[1].trace.copy())
    recording.frames["observable_rotation"] = False
    for dof in Dof:
        recording.trace[f"true_{dof.label}"] = np.nan
    for index, axis in enumerate(figures.figure9(None, recording).axes[3:]):
        assert [text.get_text() for text in axis.texts] == ["not measured"] * (index == 1)


def test_the_operator_figure_has_both_tips_and_both_errors(
    runs: tuple[Recording, Recording],
) -> None:
    """A shift of each tip shows in its own line, in the display unit."""
    free, run = (replace(each, trace=each.trace.copy()) for each in runs)
    shift = 7e-3
    for each in (free, run):
        each.trace["time"] += 40 + shift  # the rig's clock need not begin at 0
    run.trace["true_insertion"] = run.trace["reference_insertion"] + shift
    free.trace["true_insertion"] = free.trace["reference_insertion"] - shift
    panels = draw_operator_motion(free, run).axes
    assert [axes.get_title(loc="left")[:3] for axes in panels] == [f"({k})" for k in "adbecf"]
    before, after, *_ = panels[1].lines
    np.testing.assert_allclose(before.get_ydata(), -1e3 * shift)
    np.testing.assert_allclose(after.get_ydata(), 1e3 * shift)
    assert after.get_xdata()[0] == 0
    lines = {line.get_label(): line.get_ydata() for line in panels[0].lines}
    assert set(lines) == {
        "tip without compensation", "command", "tip with compensation", "reference",
    }  # fmt: skip


def test_figure5_labels_the_markers_at_their_features(runs: tuple[Recording, Recording]) -> None:
    snapshot = runs[1].snapshot
    assert snapshot is not None
    figure = figures.figure5(snapshot, runs[1].config)
    labels = {text.get_text(): text.xy for text in figure.axes[2].texts}
    np.testing.assert_array_equal([*labels["A"], *labels["B"]], snapshot.features)
    assert figure.axes[1].images[0].get_array().any()
    legends = [axes.get_legend() for axes in figure.axes]
    texts = [legend and [text.get_text() for text in legend.get_texts()] for legend in legends]
    assert texts == [
        None,
        ["above the threshold"],
        ["region of the mask", "measured marker"],
        ["predicted s", "measured s*"],
    ]


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


def test_every_figure_has_a_row() -> None:
    assert {row.name for row in ROWS} == set(DofResult.__dataclass_fields__)
    assert [row.name for row in OPERATOR_ROWS] == list(OperatorResult.__dataclass_fields__)


def test_every_row_is_explained_and_a_missed_goal_is_named(demo: Demo) -> None:
    best = {
        dof: replace(each, reduction=0.9496, tip_overspeed=2.0 + 1e-12, reduction_max=0.9)
        for dof, each in demo.results[0].items()
    }
    best[Dof.ROTATION] = replace(best[Dof.ROTATION], reduction=0.95)
    text = demo_report(
        replace(demo, config=demo.config.replace(profile="best"), results=(best, best)), []
    )
    page = Page(text)
    for row in (*ROWS, *OPERATOR_ROWS):
        assert row.meaning in page.text
    assert "<b>missed: insertion 95.0 %, bending 95.0 %</b>" in text
    assert "<td>at most 2</td><td>holds</td>" in text
    assert "<td>at least 90 %</td><td>holds</td>" in text
    assert "<td>at most 2 mm, 0.5 rad, 0.25 rad</td><td>holds</td>" in text
    assert "missed" not in demo_report(demo, []), "the goals are not those of profile paper"


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
    found = tables.to_json("paper", [0], [unknown], [figures], sim_seconds=1.0, wall_seconds=1.0)
    assert found["hand"]["bending"]["creep"] is None
    assert found["hand"]["insertion"]["largest"] == 2e-3  # in m, the rest of the object in mm
    assert found["dof"]["rotation"]["tracking_rms"] is None
    assert found["dof"]["rotation"]["worst"]["tracking_rms"] is None
    assert found["dof"]["insertion"]["unit"] == "mm"
    inside = unknown[Dof.INSERTION].compensated
    assert found["dof"]["insertion"]["compensated"] == pytest.approx(1e3 * inside)
