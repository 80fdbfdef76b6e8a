"""A run as one HTML page that stands alone: no network, no script, prints well."""

from __future__ import annotations

import base64
import importlib.metadata
import io
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from tautscope._core import __version__
from tautscope.config import Config, dump_config
from tautscope.report import tables
from tautscope.report.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tautscope.report.demo import Demo

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; margin: 2.5rem auto;
       max-width: 62rem; padding: 0 1.5rem; }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
p.lead { color: #555; margin-top: 0; } figure { margin: 1.2rem 0; }
figcaption, .note { color: #555; font-size: .88rem; max-width: 50rem; }
figure img { width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .28rem .5rem; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { border-bottom: 1.5px solid #222; font-weight: 600; }
thead tr:first-child:not(:last-child) th { border-bottom: 0; text-align: center; }
tbody tr + tr td { border-top: 1px solid #e4e4e4; }
.first { padding-left: 2rem; color: #777; }
td.ours { font-weight: 600; }
td small { display: block; color: #777; font-weight: 400; line-height: 1.1; }
pre { background: #f6f6f6; padding: .8rem 1rem; font-size: .8rem; line-height: 1.4;
      overflow-x: auto; }
dl { display: grid; grid-template-columns: max-content auto; gap: .1rem 1.5rem; }
dt { color: #555; } dd { margin: 0; }
@media print { body { margin: 0; max-width: none; font-size: 10pt; }
  h2 { break-after: avoid; } figure, tr { break-inside: avoid; } pre { white-space: pre-wrap; } }
"""

_CAVEATS = """
<ul class="note">
<li>Everything here is a simulation. The plant is a rigid-body model with friction and elasticity,
not an instrument; the figures say how the method works on that plant. This is research software,
not a medical device.</li>
<li>The article's figures were measured on its own rig with the tip as its camera saw it; the
twin's widths are of its true tip. The rows &ldquo;by camera&rdquo; compare like with like.</li>
<li>The instrument's geometry, the camera's pose, the reference's amplitudes and the estimator's
parameters are not in the article; the configuration below has the ones used. The twin's friction
is set so that the uncompensated widths resemble the article's: agreement of those rows is by
construction, agreement of the compensated ones is not.</li>
<li>With a gain of K while slack is crossed and the width known exactly, 1 &minus; 1/K of it goes:
80&nbsp;% at 5. A width estimated a little too wide removes more, one too narrow less. That is
profile &ldquo;paper&rdquo;; in &ldquo;best&rdquo; the command goes on in contact until the whole
offset is made up for.</li>
</ul>
"""

_PROFILES = {
    "paper": "&ldquo;Paper&rdquo; is the article&rsquo;s scheme on the twin.",
    "best": "&ldquo;Best&rdquo; is this project&rsquo;s own scheme on the same twin.",
}


@dataclass(frozen=True)
class Picture:
    """A figure and what it shows."""

    figure: Figure
    caption: str


def demo_report(demo: Demo, pictures: Sequence[Picture]) -> str:
    """The page of ``tautscope demo``, with the pictures in the order given."""
    seeds, profiles = demo.seeds, demo.by_profile
    several = len(seeds) > 1
    count = f"{len(seeds)} seeds" if several else "one seed"
    facts = {
        "tautscope": __version__,
        "Python": platform.python_version(),
        **{name: _version(name) for name in ("numpy", "mujoco", "opencv-python-headless")},
        "machine": f"{platform.system()} {platform.machine()}",
        "seeds": ", ".join(map(str, seeds)),
        "simulated": f"{demo.sim_seconds:.0f} s in {(1 + len(profiles)) * len(seeds)} runs",
        "took": f"{demo.wall_seconds:.0f} s",
    }
    return _page(
        f"on a simulated instrument, camera images the only feedback; {count}",
        f"""<h2>Table 1</h2>
<div class="wide">{_table(profiles)}</div>
<p class="note">{"Median over the seeds, the worst seed in brackets. " if several else ""}{
            " ".join(_PROFILES[name] for name in profiles)
        }
Widths over the last two periods of each degree of freedom: mean over 41 levels across the central
80&nbsp;% of the tip&rsquo;s range, of the true tip unless said otherwise.</p>
{_noticed(demo.compensated.warnings)}
<h2>Figures{f", profile {demo.config.profile}" if len(profiles) > 1 else ""}</h2>
{_figures(pictures)}
<h2>What this shows, and what it does not</h2>
{_CAVEATS}""",
        facts,
        demo.config,
    )


def run_report(
    config: Config,
    facts: dict[str, str],
    results: Results,
    pictures: Sequence[Picture],
    noticed: Sequence[str],
) -> str:
    """The page of ``tautscope run``: what the camera saw, of one run or of two."""
    return _page(
        "on the drives and the camera named below",
        f"""<h2>Table 1</h2>
<div class="wide">{_table({"rig": [results]}, by_camera=True)}</div>
<p class="note">As the camera sees it; no rig knows its true tip. The tracking error includes
the first period, in which the slack is learnt. The article&rsquo;s figures are of its own rig.</p>
{_noticed(noticed)}
<h2>Figures</h2>
{_figures(pictures)}""",
        {"tautscope": __version__, **facts},
        config,
    )


def _page(where: str, body: str, facts: dict[str, str], config: Config) -> str:
    facts_list = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts.items())
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>tautscope: hysteresis reduction</title><style>{_STYLE}</style></head><body>
<h1>Hysteresis reduction from the endoscope&rsquo;s images</h1>
<p class="lead">The experiment of Reilink, Stramigioli and Misra (Mechatronics 23, 2013, 652, doi
10.1016/j.mechatronics.2013.06.006) {where}.</p>
{body}
<h2>Made with</h2>
<dl>{facts_list}</dl>
<h2>Configuration</h2>
<pre>{escape(dump_config(config))}</pre>
</body></html>
"""


def _figures(pictures: Sequence[Picture]) -> str:
    return "".join(_figure(picture) for picture in pictures)


def _noticed(lines: Sequence[str]) -> str:
    """What the guards noticed in the compensated run, of the first seed if there are several."""
    said = "".join(f"<li>{escape(line)}</li>" for line in lines) or "<li>nothing</li>"
    return f'<h2>Noticed by the guards</h2><ul class="note">{said}</ul>'


def _table(columns: Mapping[str, Sequence[Results]], by_camera: bool = False) -> str:
    """The article beside each column, a result per seed; the last one stands out.

    By camera, the article stands beside what the camera saw, and rows of which nothing is known
    are left out.
    """
    figures = [(each, tables.median(each), tables.worst(each)) for each in columns.values()]
    *_, (last, dofs, _) = figures
    span = 1 + len(columns)
    heads = "".join(f'<th colspan="{span}">{tables.heading(dof)}</th>' for dof in dofs)
    names = "".join(f"<th>{escape(name)}</th>" for name in columns)
    names = f'<th class="first">article</th>{names}' * len(dofs)
    lines = []
    for row in tables.ROWS:
        if by_camera and all(math.isnan(getattr(found, row.name)) for found in dofs.values()):
            continue
        cells = []
        for dof in dofs:
            article = tables.article_cell(row, dof, by_camera)
            cells.append(f'<td class="first">{article}</td>')
            for results, middle, bad in figures:
                value = tables.cell(row, dof, getattr(middle[dof], row.name))
                worst = tables.cell(row, dof, getattr(bad[dof], row.name))
                note = f"<small>({worst})</small>" if len(results) > 1 else ""
                mark = ' class="ours"' if results is last else ""
                cells.append(f"<td{mark}>{value}{note}</td>")
        lines.append(f"<tr><td>{escape(row.title)}</td>{''.join(cells)}</tr>")
    return (
        f"<table><thead><tr><th></th>{heads}</tr><tr><th></th>{names}</tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table>"
    )


def _figure(picture: Picture) -> str:
    data = io.BytesIO()
    picture.figure.savefig(data, format="jpg", dpi=170, pil_kwargs={"quality": 88})
    code = base64.b64encode(data.getvalue()).decode()
    caption = escape(picture.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/jpeg;base64,{code}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
