"""The loop's filter on real records: the records themselves, ratios and goals."""

import numpy as np
import pytest
from common.paths import ROOT
from records import continuum, loop
from tautscope.analysis.comparison import HORIZONS

NEEDS_RECORDS = pytest.mark.skipif(not continuum.robots(), reason="TAUTSCOPE_DATA has no opencr")


def errors(filtered: float, last: float, gain: float, mixture: float) -> loop.Errors:
    values = {"filter": filtered, "last_tip": last, "last_tip_gain": gain, "best": mixture}
    return {name: [value] * len(HORIZONS) for name, value in values.items()}


def test_rows_compare_the_filter_with_the_better_trivial_predictor_and_the_mixture() -> None:
    found = {"a": errors(1.0, 4.0, 2.0, 0.5), "b": errors(1.02, 1.0, 3.0, 1.0)}
    rows = {row["what"]: row for row in loop.to_rows(found, {"a": errors(2.0, 1, 1, 1)})}
    own = "filter over the better trivial predictor"
    assert rows[f"a, 3%: {own}"]["median"] == 0.5 and rows[f"a, 3%: {own}"]["holds"]
    assert rows[f"b, 1%: {own}"]["holds"] and not rows[f"b, 3%: {own}"]["holds"]
    assert rows[f"records, 3%: {own}, worst"]["median"] == 1.02
    mixture = rows["records, 10%: filter over the mixture"]
    assert mixture["median"] == pytest.approx((2 + 1.02) / 2) and mixture["n"] == 2
    assert not mixture["holds"]
    before = rows["records, 3%: filter over the baseline's"]
    assert before["median"] == 0.5 and before["holds"] and before["n"] == 1
    shown = loop.table(found, list(rows.values()))
    assert "| a, 1 | 0.50 | 0.50 | 0.50 | 1 |" in shown
    assert "| all, filter over the mixture | 1.51 (2.00) | 1.51 (2.00) | 1.51 (2.00) | |" in shown
    assert "| worse than trivial | 1 | 1 | 1 | |" in shown
    assert "| tools, 2 | 0.76 (1.02) |" in loop.table(
        {"tool_a": found["a"], "tool_b": found["b"]}, []
    )


def test_a_horizon_with_too_few_sights_has_no_row() -> None:
    found = {"a": errors(1.0, 4.0, 2.0, 0.5)}
    for values in found["a"].values():
        values[HORIZONS.index(0.1)] = np.nan
    assert {row["horizon"] for row in loop.to_rows(found)} == {0.01, 0.03}


@NEEDS_RECORDS
@pytest.mark.parametrize("name", continuum.RECORDS)
def test_the_tip_of_the_continuum_robot_follows_the_command(name: str) -> None:
    command, tip = continuum.read(name)
    assert command.shape == tip.shape and len(command) > 100
    assert np.corrcoef(command, tip)[0, 1] > 0.95


@NEEDS_RECORDS
def test_the_filter_is_evaluated_beside_trivial_predictors_and_mixture() -> None:
    found = loop.evaluate("continuum seg1, axis 1")
    assert set(found) == set(loop.COMPARED)
    assert all(np.isfinite(values).all() for values in found.values())
    assert max(found["best"]) < min(found["last_tip"])


def test_the_page_has_a_section_for_the_table() -> None:
    page = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
    assert page.index("<!-- loop: begin -->") < page.index("<!-- loop: end -->")
