"""Figures of runs: what is drawn, and no global state."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from tautscope.dof import Dof
from tautscope.figure_style import BLUE, ORANGE
from tautscope.loop.vision import MarkerDetector
from tautscope.report import figures
from tautscope.report.operator_figure import draw_operator_motion
from tautscope.runs.recording import Recording


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


def test_the_mask_of_figure5_is_that_of_its_regions(runs: tuple[Recording, Recording]) -> None:
    """Also where the trained discriminant finds nothing, and an alternative is used."""
    snapshot, config = runs[1].snapshot, runs[1].config
    assert snapshot is not None
    trained = figures.figure5(snapshot, config).axes[1].images[0].get_array()
    dark = config.replace(**{
        "vision.weights": (1.0, 1.0, 1.0),
        "vision.threshold": 200.0,
        "vision.alternatives": (((0.5, 0.5, 0.5), 200.0), ((-0.525, 1.0, -0.648), 5.0)),
    })  # fmt: skip
    detector = MarkerDetector(dark)
    assert detector.detect(snapshot.image, snapshot.predicted_features).discriminant == 2
    figure = figures.figure5(snapshot, dark)
    np.testing.assert_array_equal(figure.axes[1].images[0].get_array(), trained)
    assert len(figure.axes[2].patches) >= 2


@pytest.mark.parametrize("index", range(5))
def test_every_discriminant_has_a_mask(
    runs: tuple[Recording, Recording], monkeypatch: pytest.MonkeyPatch, index: int
) -> None:
    snapshot = runs[1].snapshot
    assert snapshot is not None
    detect = MarkerDetector.detect
    monkeypatch.setattr(
        MarkerDetector,
        "detect",
        lambda *arguments: replace(detect(*arguments), discriminant=index),
    )
    assert figures.figure5(snapshot, runs[1].config).axes[1].images[0].get_array().any()


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
