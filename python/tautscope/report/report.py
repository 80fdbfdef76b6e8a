"""The report of a run: one self-contained HTML page without scripts or network access."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from html import escape
from typing import TYPE_CHECKING, Literal

from tautscope.config import Config, dump_config
from tautscope.dof import Dof, NamedDof
from tautscope.report import tables
from tautscope.report.operator_motion import OPERATOR_ROWS, OperatorResults
from tautscope.report.results import ROWS, Figures, Results, combine
from tautscope.report.rows import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; margin: 2.5rem auto;
       max-width: 62rem; padding: 0 1.5rem; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
p.lead { color: #555; margin-top: 0; } .verdict { font-size: 1.1rem; max-width: 50rem; }
figure { margin: 1.2rem 0; }
figcaption, .note { color: #555; font-size: .88rem; max-width: 50rem; }
figure img { width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .28rem .5rem; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
.meanings th, .meanings td { text-align: left; vertical-align: top; font-size: .88rem; }
.meanings td { white-space: normal; } .meanings td:nth-child(2) { color: #555; min-width: 20rem; }
.meanings td:nth-child(3) { min-width: 6.5rem; }
details { margin: 1rem 0; } summary { cursor: pointer; font-weight: 600; }
thead th { border-bottom: 1.5px solid #222; font-weight: 600; }
.figures :is(th, td:first-child) { white-space: normal; }
thead tr:first-child:not(:last-child) th { border-bottom: 0; text-align: center; }
tbody tr + tr td { border-top: 1px solid #e4e4e4; }
.first { padding-left: 2rem; color: #777; }
td.ours { font-weight: 600; }
td small { display: block; color: #777; font-weight: 400; line-height: 1.1; }
pre { background: #f6f6f6; padding: .8rem 1rem; font-size: .8rem; line-height: 1.4;
      overflow-x: auto; }
dl { display: grid; grid-template-columns: max-content auto; gap: .1rem 1.5rem; }
dt { color: #555; } dd { margin: 0; }
@media (max-width: 45rem) { body { padding: 0 1rem; } .first { padding-left: .5rem; }
  td:first-child { white-space: normal; }
  figure { overflow-x: auto; } figure img:not([src^="data:image/gif"]) { min-width: 40rem; }
  figcaption { position: sticky; left: 0; max-width: calc(100vw - 2rem); }
  .meanings :is(th, td):nth-child(n) { min-width: 0; white-space: normal; font-size: .8rem; }
  .figures td:first-child { position: sticky; left: 0; min-width: 7rem; background: #fff; } }
@media print { body { margin: 0; max-width: none; font-size: 10pt; } .wide { overflow: visible; }
  h2 { break-after: avoid; } figure, tr { break-inside: avoid; } pre { white-space: pre-wrap; } }
"""

FIGURE5_CAPTION = (
    "Fig. 5. One image of the run: (a) the image, (b) the pixels above the discriminant's "
    "threshold, (c) the regions of these pixels with markers A and B, and (d) measured and "
    "predicted features."
)
_IMAGES = "the endoscope\u2019s images"
_UNKNOWN_TIP = ": the true state of the tip is not known on hardware"


def table1_section(results: Results, *, is_tip_known: bool = False) -> str:
    """Table 1 of a recorded run."""
    start = (
        "Of the true tip where it is not said to be by camera."
        if is_tip_known
        else f"Figures are by camera{_UNKNOWN_TIP}. The tracking error includes the first period, "
        "in which the contact offsets are estimated."
    )
    rows = measured_rows(results, ROWS)
    return f"""<h2>Table 1</h2>
<div class="wide">{figures_table({"rig": [results]}, rows, "by camera")}</div>
<p class="note">{start} The article&rsquo;s figures are of its own rig.</p>
{row_explanations(rows)}"""


def recorded_motion_section(results: OperatorResults, tip: str) -> str:
    """The tracking of a recorded motion, with the words for whose tip it is."""
    rows = measured_rows(results, OPERATOR_ROWS)
    return f"""<h2>Recorded motion</h2>
<div class="wide">{figures_table({"": [results]}, rows)}</div>
<p class="note">Figures are {tip}{"" if tip == "of the true tip" else _UNKNOWN_TIP}.
The first 40&nbsp;s, or half of a shorter run, do not count: there the contact offsets are
estimated.</p>
{row_explanations(rows, has_goals=set(results) <= set(Dof))}"""


def page(where: str, body: str, facts: dict[str, str], config: Config) -> str:
    """The page around a body, with the facts of the run, its date and its configuration."""
    facts = facts | {"written": report_time(datetime.now())}
    facts_list = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts.items())
    return document(
        f"Hysteresis reduction from {'measurements of the tip' if config.dof else _IMAGES}",
        f"""After Reilink, Stramigioli and Misra (Mechatronics 23, 2013, 652, doi
10.1016/j.mechatronics.2013.06.006), {where}.""",
        f"""{body}
<h2>Run</h2>
<dl>{facts_list}</dl>
{configuration(config)}""",
    )


def report_time(time: datetime) -> str:
    """A date and time with the offset of the zone, to the minute."""
    return time.astimezone().isoformat(" ", "minutes")


def configuration(config: Config) -> str:
    """All values, folded."""
    return (
        "<details><summary>Configuration</summary>"
        f"<pre>{escape(dump_config(config))}</pre></details>"
    )


def document(title: str, lead: str, body: str) -> str:
    """A self-contained page: title and lead as text, body as HTML."""
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>tautscope: {escape(title)}</title><style>{_STYLE}</style></head><body>
<h1>{escape(title)}</h1>
<p class="lead">{escape(lead)}</p>
{body}
</body></html>
"""


def figure_list(figures: Iterable[tuple[Figure, str]]) -> str:
    """The figures with their captions, one below the other."""
    parts = []
    for figure, caption in figures:
        data = io.BytesIO()
        figure.savefig(data, format="jpg", dpi=170, pil_kwargs={"quality": 88})
        parts.append(embedded(data.getvalue(), "jpeg", caption))
    return "".join(parts)


def warning_list(warnings: Sequence[str]) -> str:
    """The section of warnings: flags raised in a run, and disabled monitors."""
    items = "".join(f"<li>{escape(line)}</li>" for line in warnings) or "<li>none</li>"
    return f'<h2>Warnings</h2><ul class="note">{items}</ul>'


def figures_table(
    columns: Mapping[str, Sequence[dict[NamedDof, Figures]]],
    rows: Sequence[Row],
    article: Literal["true tip", "by camera"] | None = None,
) -> str:
    """A table of figures: per DOF each column's median over the seeds, and the worst.

    Args:
        columns: Figures per seed, by the column's title.
        rows: The rows.
        article: Whether the article's figures, which are by camera, are in a column of their own,
            and beside the figures of what; then the last column is bold.
    """
    sources = [(combine(of, "median"), combine(of, "worst"), len(of)) for of in columns.values()]
    dofs = list(sources[0][0])
    span = f' colspan="{1 + len(columns)}"' if article else ""
    heads = "".join(f"<th{span}>{tables.heading(dof)}</th>" for dof in dofs)
    head = f"<tr><th></th>{heads}</tr>"
    if article:
        names = "".join(f"<th>{escape(name)}</th>" for name in columns)
        names = f'<th class="first">article</th>{names}' * len(dofs)
        head += f"<tr><th></th>{names}</tr>"
    lines = []
    for row in rows:
        cells = []
        for dof in dofs:
            if article:
                figure = tables.article_cell(row, dof, article == "by camera")
                cells.append(f'<td class="first">{figure}</td>')
            for source in sources:
                value, worst = (
                    tables.cell(row, dof, getattr(each[dof], row.name)) for each in source[:2]
                )
                note = f"<small>({worst})</small>" if source[2] > 1 else ""
                mark = ' class="ours"' if article and source is sources[-1] else ""
                cells.append(f"<td{mark}>{value}{note}</td>")
        lines.append(f"<tr><td>{escape(row.title)}</td>{''.join(cells)}</tr>")
    return f'<table class="figures"><thead>{head}</thead><tbody>{"".join(lines)}</tbody></table>'


def row_explanations(
    rows: Sequence[Row],
    results: Sequence[dict[NamedDof, Figures]] = (),
    *,
    has_goals: bool = True,
) -> str:
    """A table of what each row means, its goal, and for which DOFs results of ``best`` meet it.

    Args:
        rows: Rows of the table above it.
        results: Results per seed, of which the median counts; none for another profile or rig.
        has_goals: Whether to show the goals, which are those of the article's instrument.
    """
    middle: dict[NamedDof, Figures] = combine(results, "median") if results else {}
    lines = []
    for row in rows:
        values = {dof: getattr(each, row.name) for dof, each in middle.items()}
        missed = ", ".join(
            f"{dof.label} {tables.exact_cell(row, dof, value)}"
            for dof, value in values.items()
            if row.is_missed(dof, value)
        )
        verdict = f"<b>missed: {missed}</b>" if missed else "holds" if row.goal else ""
        goal = f"<td>{tables.goal_text(row)}</td>" * has_goals
        lines.append(
            f"<tr><td>{escape(row.title)}</td><td>{escape(row.meaning)}</td>{goal}"
            + f"<td>{verdict}</td>" * bool(results)
            + "</tr>"
        )
    heads = "<th>row</th><th>what it is</th>" + "<th>goal</th>" * has_goals
    heads += "<th>result</th>" * bool(results)
    note = (
        '<p class="note">Goals are for profile &ldquo;best&rdquo; and the median of several '
        "seeds; rows without one describe the instrument or explain the others.</p>"
    )
    return (
        '<details open><summary>What the rows mean</summary><table class="meanings">'
        f"<thead><tr>{heads}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
        f"{note * has_goals}</details>"
    )


def measured_rows(results: Mapping[NamedDof, Figures], rows: Sequence[Row]) -> list[Row]:
    """The rows with a value for a DOF."""
    figures = results.values()
    return [row for row in rows if not all(math.isnan(getattr(each, row.name)) for each in figures)]


def operator_section(profile: str, results: Sequence[OperatorResults]) -> str:
    """The section of the operator motion of ``tautscope demo``."""
    return f"""<h2>Operator motion</h2>
<div class="wide">{figures_table({"": results}, OPERATOR_ROWS)}</div>
<p class="note">Profile &ldquo;{profile}&rdquo;. All degrees of freedom make minimum-jerk moves
between random targets at the same time, with rests; the first 40&nbsp;s do not count. Errors are of
the true tip, and their mean is not removed. Creep is the travel of the tip while every reference
rests. The bound is the reduction of a law with exact knowledge, on ideal plays of the widths of the
article.</p>
{row_explanations(OPERATOR_ROWS, results if profile == "best" else ())}"""


def embedded(data: bytes, kind: str, caption: str) -> str:
    """A figure of an encoded image, ``jpeg``, ``png`` or ``gif``, in the page itself."""
    code, text = base64.b64encode(data).decode(), escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/{kind};base64,{code}">'
        f"<figcaption>{text}</figcaption></figure>"
    )
