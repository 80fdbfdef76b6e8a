"""The campaign over drawn instruments: the draw, what the loop is told, the rows, the cluster."""

import re
import subprocess
import sys
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from common.paths import ROOT
from common.processes import run_parallel
from instruments import explanation, properties, runs
from instruments.alarms import alarm_table
from instruments.properties import TABLE, draw_instrument, markdown_table
from instruments.rows import seed_rows, summary_rows, table
from instruments.runs import Figures, Run, simulate
from scipy.spatial.transform import Rotation
from tautscope.config import Config, load_config
from tautscope.dof import Dof
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.rig import Frame
from tautscope.loop.safety import Reaction, Supervision
from tautscope.report.metrics import loop_width
from tautscope.twin import Twin
from tautscope.twin.plant import Plant

NEUTRAL = {
    each.name: 1.0 if each.name.split()[0] in {"width", "gain"} else 0.0 for each in TABLE
} | {
    "rounding shaft": 1.0,
    "rounding section": 0.03,
    "frame rate": 25.0,
    "latency": 80.0,
    "brightness": 105.0,
    "quality": 90.0,
}
"""Values with which the instrument is the nominal one, but for its images."""


def test_every_property_is_within_its_range_and_the_seed_decides() -> None:
    drawn = [draw_instrument(seed) for seed in range(40)]
    for each in TABLE:
        values = np.array([instrument.values[each.name] for instrument in drawn])
        assert np.all((each.low <= values) & (values <= each.high)), each.name
        assert np.ptp(values) > 0.7 * (each.high - each.low), each.name
    assert draw_instrument(7) == drawn[7] != drawn[8]
    assert len({each.name for each in TABLE}) == len(TABLE)


def test_neutral_values_are_the_nominal_instrument() -> None:
    nominal = load_config()
    changes = properties._instrument(NEUTRAL, nominal)
    images = {"twin.sensor.jpeg_quality": None, "twin.sensor.exposure_time_constant": 0.0}
    assert nominal.replace(**changes | images) == nominal


@pytest.mark.parametrize("seed", range(5))
def test_the_loop_is_told_another_geometry_and_the_same_else(seed: int) -> None:
    drawn = draw_instrument(seed)
    actual, told, values = drawn.actual, drawn.told, drawn.values
    assert told.twin == actual.twin
    assert {
        name for name in Config.__struct_fields__ if getattr(told, name) != getattr(actual, name)
    } == {"camera", "instrument"}
    poses = [each.camera.camera_from_guide for each in (actual, told)]
    turn = Rotation.from_rotvec(poses[1].rotation) * Rotation.from_rotvec(poses[0].rotation).inv()
    assert np.rad2deg(turn.magnitude()) == pytest.approx(values["told tilt"])
    shift = np.subtract(poses[1].translation, poses[0].translation)
    assert 1e3 * np.linalg.norm(shift) == pytest.approx(values["told shift"])
    focal, length = told.camera.fx / actual.camera.fx, told.instrument.bending_length
    assert 100 * (focal - 1) == pytest.approx(values["told focal length"])
    section = 100 * (length / actual.instrument.bending_length - 1)
    assert section == pytest.approx(values["told section"])


@pytest.mark.parametrize(("variant", "is_exact"), [("best", False), ("best exact", True)])
def test_the_twin_is_the_actual_and_the_loop_has_the_told_configuration(
    monkeypatch: pytest.MonkeyPatch, variant: runs.Variant, is_exact: bool
) -> None:
    seen: list[Config] = []

    def record(config: Config, **_: Any) -> Twin:
        seen.append(config)
        raise InterruptedError

    monkeypatch.setattr(runs, "Twin", record)
    with pytest.raises(InterruptedError):
        simulate(Run(3, "hand", variant, True))
    drawn = draw_instrument(3)
    assert seen == [drawn.actual]
    assert runs._told(drawn, variant) == (drawn.actual if is_exact else drawn.told)


@pytest.mark.parametrize(
    ("dof", "width", "gain", "compliance"),
    [
        (Dof.INSERTION, 0.5, 0.6, 0.0),
        (Dof.ROTATION, 1.4, 1.2, 0.0),
        (Dof.BENDING, 1.2, 0.7, 0.05),
    ],
)
def test_loops_are_as_wide_as_drawn(dof: Dof, width: float, gain: float, compliance: float) -> None:
    nominal = load_config()
    start = np.array([nominal.experiment[each].centre for each in Dof])
    sine = nominal.experiment[dof].amplitude * 1.5 * np.sin(2 * np.pi * np.arange(4000) / 2000)

    def measured(**values: float) -> float:
        changes = properties._instrument(NEUTRAL | values, nominal)
        plant = Plant(nominal.replace(**changes), np.random.default_rng(0))
        tips = np.empty_like(sine)
        for k, offset in enumerate(sine):
            command = start.copy()
            command[dof] += offset
            plant.step(command)
            tips[k] = plant.true_state[dof]
        return loop_width(sine[2000:], tips[2000:]).mean

    drawn = measured(
        **{f"width {dof.label}": width, f"gain {dof.label}": gain, "compliance": compliance}
    )
    assert drawn / measured() == pytest.approx(width, rel=0.06)


def test_features_are_those_of_the_full_image() -> None:
    """Without images the truth comes from small ones; the noise of 0.2 px is on top."""
    actual = draw_instrument(2).actual
    small, large = (Twin(each) for each in (runs.without_image_effects(actual), actual))
    seen: list[np.ndarray] = []

    class Loop:
        supervision = Supervision(Reaction.WARN, ("lost",), (), 1.0)

        def on_features(self, features: np.ndarray, captured_at: float) -> Any:
            seen.append(features)
            return type("Report", (), {"status": "ok"})

    look = runs._Look(Run(2, "hand", "best", False), figures := Figures())
    loop: HysteresisReduction = Loop()  # type: ignore[assignment]
    expected = []
    command = np.array([actual.experiment[dof].centre for dof in Dof])
    frames: list[list[Frame]] = [[], []]
    for rig, delivered in zip((small, large), frames, strict=True):
        rig.reset()
        samples = [rig.step(command) for _ in range(300)]
        delivered.extend(each.frame for each in samples if each.frame is not None)
    for one, other in zip(*frames, strict=True):
        look(loop, one)
        expected.append(other.true_features)
    difference = np.array(seen) - np.array(expected)
    assert np.abs(difference.mean(axis=0)).max() < 0.2
    assert difference.std() == pytest.approx(0.2, rel=0.3)
    assert figures.visible == len(frames[0]) > 10
    assert figures.flags == {"lost": figures.images} == {"lost": len(frames[0])}


def test_alarms_count_instruments_within_a_hundredth_of_the_images() -> None:
    rows: list[dict[str, Any]] = [
        {"motion": "hand", "runs": {"best": {"images": 1000, "flags": flags}}}
        for flags in ({"lost": 10, "late": 1000}, {"lost": 11}, {})
    ]
    rows.append({"motion": "sines", "runs": {"best": {"images": 10, "flags": {"frozen": 10}}}})
    *_, lost, late = alarm_table(rows).splitlines()
    assert lost == "| lost | 1.0 % | 1.1 % | 2 |"
    assert late.startswith("| late | 0.0 % |") and late.endswith("| 2 |")
    assert alarm_table([{"motion": "hand", "runs": {}}]) == ""


def figures(spread: float, refused: int = 0, stopped: str | None = None) -> Figures:
    statuses = {"ok": 100 - refused, "refused": refused}
    return Figures([spread] * 3, [0.0] * 3, [spread] * 3, 100, statuses, stopped)


def found(reductions: dict[runs.Variant, list[float]]) -> dict[Run, Figures]:
    results = {
        Run(seed, "hand", variant, False): figures(1 - value, refused=2)
        for variant, values in reductions.items()
        for seed, value in enumerate(values)
    }
    seeds = range(len(next(iter(reductions.values()))))
    return results | {Run(seed, "hand", "none", False): figures(1.0) for seed in seeds}


def test_quantities_over_all_seeds_are_those_of_the_goals() -> None:
    best, paper = [0.9, 0.8, -0.1, 0.7], [0.5, 0.82, 0.0, 0.74]
    rows = seed_rows(found({"best": best, "paper": paper, "best exact": [0.9] * 4}))
    values = {(row["what"], row["dof"]): row["median"] for row in summary_rows(rows)}
    assert values["reduction, median", "rotation"] == pytest.approx(0.75)
    assert values["worse than none", "rotation"] == 0.25
    assert values["worse than paper by 3 points", "rotation"] == 0.5
    assert values["lost by what is told wrongly, median", "rotation"] == pytest.approx(0.15)
    assert values["visible images not used", None] == pytest.approx(0.02)
    assert "| -10 (2) / -10 (2) / -10 (2) |" in table(rows, "hand")


def test_a_stopped_run_is_worse_than_none_and_an_unfinished_seed_is_left_out() -> None:
    results = found({"best": [0.9, 0.8]})
    results[Run(0, "hand", "best", False)] = figures(0.1, stopped="held")
    rows = seed_rows(results)
    assert rows[0]["runs"]["best"]["reduction"] == [-1.0] * 3
    del results[Run(1, "hand", "none", False)]
    assert [row["seed"] for row in seed_rows(results)] == [0]


def test_the_property_that_matters_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explanation, "TREES", 10)
    values = [draw_instrument(seed).values["latency"] for seed in range(40)]
    text = explanation.explain(
        seed_rows(found({"best": [1 - each / 250 for each in values]})), "hand"
    )
    first = re.search(r"rotation: (\S+) \S+ \((\S+)\)", text)
    assert first is not None and first[1] == "latency" and float(first[2]) < -0.95, text


def test_a_cluster_of_two_workers_gives_the_same_figures() -> None:
    jobs: list[Run] = [Run(seed, "hand", "none", False, 42.0) for seed in (5, 6)]
    remote = dict(run_parallel(simulate, jobs, 1, "local:2"))
    for job in jobs:
        assert asdict(remote[job]) == asdict(simulate(job)), job
        assert remote[job].spread[0] > 0


def test_a_motion_that_ends_before_it_counts_is_refused() -> None:
    command = [sys.executable, str(ROOT / "benchmarks/instruments"), "--duration", "40"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--duration 40: must be above 40 s" in done.stderr


def test_a_missing_cluster_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dask", None)
    with pytest.raises(SystemExit, match="uv sync --extra cluster"):
        list(run_parallel(abs, [1], 1, "tcp://127.0.0.1:1"))


def test_the_page_has_the_ranges_of_the_source() -> None:
    page = (ROOT / "docs" / "instruments.md").read_text(encoding="utf-8")
    assert markdown_table() in page
