"""The page docs/conditions.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common.doc_pages import ROOT
from conditions.frames import MAX_ERROR, STATE_ERROR, TOUCHING_GAP, WORKSPACE
from conditions.rows import table

DEFINITIONS = f"""\
Each frame is an image of the twin at another pose, drawn uniformly: insertion
{WORKSPACE[0, 0] * 1e3:.0f} to {WORKSPACE[1, 0] * 1e3:.0f} mm, rotation {WORKSPACE[0, 1]:g} to \
{WORKSPACE[1, 1]:g} rad, bending {WORKSPACE[0, 2]:g} to {WORKSPACE[1, 2]:g} rad, constant curvature.
Half of the frames have a real colon frame as background, half procedural mucosa. The sequence
number, which determines the phase of a disturbance and the background, is drawn at random.

- **n**: number of frames; **visible**: frames with at least half of each band visible.
- **valid**: share of the visible frames in which the detection is valid.
- **wrong accepted**: share of all frames in which it is valid although a marker is more than
  {MAX_ERROR:g} px from the truth, or is not in the image.
- **error**: RMS distance between measured and true features over all valid frames, wrong ones
  included. Markers that are not in the image have no distance; they count as wrong accepted only.
- **with prediction**: as in the loop, with a predicted state and its standard deviation, and the
  features by `FeatureModel`. The prediction is the true state plus a normal error of
  {STATE_ERROR[0] * 1e3:g} mm, {STATE_ERROR[1]:g} rad, {STATE_ERROR[2]:g} rad.
- **without**: from the image alone.

The true feature is the centroid of the *whole* near side of a band, also where debris, a
highlight, text, the field stop, the image border or the instrument covers a part of it, because
the loop's model predicts this centroid. The centroid of the visible part would be an error. The
visible share is the share of that side, by area in the image, that is inside the image and not
covered; a saturated highlight covers it, smoke, blur and exposure do not.

The disturbances are those of `python/tautscope/twin/disturbances.py`. Their strength
varies over the frames, from zero to the limits: debris up to 40 % of a band,
smoke up to 65 % of the light, exposure 0.25 to 4 times the grey levels, white balance 0.8 to 1.25
per channel, motion blur up to 8 px, defocus up to 5 px, the black field stop over up to 45 % of a
band. Exposure is harder here than in a camera, which compresses the light into grey levels.
"Outside the image" and "touching" are selected by pose: a band cut by the border with at least half
of it visible; a gap of less than {TOUCHING_GAP} px between the bands.
"""


def write(rows: Sequence[dict[str, Any]], command: str) -> Path:
    """Write docs/conditions.md."""
    path = ROOT / "docs" / "conditions.md"
    seeds = max(row["seeds"] for row in rows)
    text = (
        "# Image conditions\n\nDetection of the markers under each image condition. Made by\n\n"
        f"    {command}\n\n(seeds 0 to {seeds - 1}). (!) marks a missed goal: valid at least "
        "99 %, wrong accepted\nat most 0.1 % (none without an instrument), error at most "
        f"0.15 px clean\nand 0.5 px otherwise.\n\n{table(rows)}\n\n"
        f"## Definitions\n\n{DEFINITIONS}"
    )
    path.write_text(text, encoding="utf-8")
    return path
