"""The figures in paper/paper.md and README.md are those of the tables that the benchmarks write."""

import re

from common.paths import ROOT
from tautscope.analysis.models.registry import MODELS

PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")


def page(name: str) -> str:
    return (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")


def listed(figures: str) -> str:
    """'88.8 / 78.0 / 78.6' as '89, 78 and 79 %'."""
    first, second, third = (f"{float(figure):.0f}" for figure in figures.split(" / "))
    return f"{first}, {second} and {third} %"


def reductions(row: str) -> list[str]:
    """Median and worst of `best`, and median of `paper`, as the paper writes them."""
    (cells,) = re.findall(rf"^\| {row} \|(.*)$", page("hysteresis"), re.MULTILINE)
    return [listed(triple) for triple in re.findall(r"-?[\d.]+(?: / -?[\d.]+){2}", cells)[:3]]


def test_the_reductions_are_those_of_hysteresis() -> None:
    best, worst, paper = reductions("operator: reduction of tracking error")
    assert f"by {best} in the median (worst {worst}), `paper` by {paper} |" in PAPER
    best, _, paper = reductions("reduction of mean width")
    assert f"loop by {paper}; the article" in PAPER
    assert f"`best` reduces it by {best} |" in PAPER


def test_the_readme_says_how_its_motion_is_followed_with_other_seeds() -> None:
    best, worst, _ = reductions("operator: reduction of tracking error")
    rotation = re.split(", | and ", worst)[1]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"Seeds 0 to 4: {best} in the median, rotation {rotation} % at worst" in readme


def test_the_reductions_are_those_of_plants() -> None:
    table = (
        page("plants").partition("<!-- plants: begin -->")[2].partition("<!-- plants: end -->")[0]
    )
    medians = [int(median) for median in re.findall(r"\| (\d+) \(\d+\) (?=\|)", table)]
    assert f"between {min(medians)} and {max(medians)} %" in PAPER


def test_the_numbers_of_models_and_faults_are_right() -> None:
    assert len(MODELS) == 9 and "nine models" in PAPER
    (kinds,) = set(re.findall(r"runs of (\d+) kinds", page("faults")))
    # One of the kinds is a run without a fault.
    assert f"each of {int(kinds) - 1} kinds of faults" in PAPER
