"""Computing time of control tick and image update of the loop, and of NumPy's pinv.

One thread. The tick is supervision, law and command history, of three DOFs and of eight. The image
update is that after the vision: checks, state and offset estimates. The article's state estimation
is h(q), its interaction matrix, the step and the rank check; NumPy only computes
``pinv(matrix) @ innovation`` for a given matrix.
"""

import argparse
import json
import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from common.rows import goal_row, print_rows
from tautscope import axes
from tautscope.config import Config, Sine, load_config
from tautscope.loop import construction
from tautscope.loop.references import OperatorMotion

REPEATS, IMAGES = 60, 50


def nanoseconds(work: Callable[[], object], per: int) -> list[float]:
    """Return the time per item of work on `per` items, once per repeat."""
    times = []
    for _ in range(REPEATS):
        start = perf_counter_ns()
        work()
        times.append((perf_counter_ns() - start) / per)
    return times


def control_tick(config: Config) -> list[float]:
    ticks, experiment = 20_000, config.experiment
    three = [experiment.insertion, experiment.rotation, experiment.bending]
    sines = [Sine(centre=0.0, amplitude=1.0)] * len(config.dof) or three
    phase = np.linspace(0.0, 40 * np.pi, ticks)
    references = np.stack([s.centre + s.amplitude * np.sin(phase) for s in sines], axis=1)
    times = np.arange(ticks) * config.control.period
    # Missing images, and a clock that goes back, would end compensation.
    blind = config.replace(**{"safety.off": ("dropped",)})
    loops = iter([construction.build_loop(blind) for _ in range(REPEATS)])
    return nanoseconds(lambda: next(loops).run(references, times), ticks)


def state_estimation(config: Config) -> tuple[list[float], list[float]]:
    count, pinv_count = 5_000, 200
    rng = np.random.default_rng(0)
    model, estimator = (
        construction.build_feature_model(config),
        construction.build_state_estimator(config),
    )
    states = rng.uniform([0.015, -1.0, 0.3], [0.035, 1.0, 1.2], (count, 3))
    predictions = [model.predict(state) for state in states]
    features, matrices = zip(*(p for p in predictions if p is not None), strict=True)
    measured = np.array(features) + rng.normal(0.0, 1.0, (len(features), 4))
    innovations = measured - np.array(features)
    states = states[[p is not None for p in predictions]]
    samples = list(zip(matrices, innovations, strict=True))[:pinv_count]

    def use_numpy() -> None:
        for matrix, innovation in samples:
            np.matmul(np.linalg.pinv(matrix), innovation)

    ours = nanoseconds(lambda: estimator.run(model, states, measured), len(states))
    return ours, nanoseconds(use_numpy, len(samples))


def in_operation(config: Config) -> tuple[list[float], list[float]]:
    """Times of a control tick and of an image update, with images of the predicted state."""
    rng = np.random.default_rng(0)
    loop, model = construction.build_loop(config), construction.build_feature_model(config)
    motion = OperatorMotion(config.experiment, seed=0, duration=1e3)
    period, tick = config.control.period, 0
    ticks, updates = [], []
    for _ in range(REPEATS):
        spent = [0, 0]
        for _ in range(IMAGES):
            times = period * np.arange(tick + 1, tick + 9)
            references, tick = np.array([motion(time) for time in times]), tick + 8
            start = perf_counter_ns()
            loop.run(references, times)
            spent[0] += perf_counter_ns() - start
            prediction = model.predict(loop.predicted_state)
            if prediction is None:
                continue
            features = prediction[0] + rng.normal(0.0, 0.2, 4)
            start = perf_counter_ns()
            loop.on_features(features, (tick - 16) * period)
            spent[1] += perf_counter_ns() - start
        ticks.append(spent[0] / IMAGES / 8)
        updates.append(spent[1] / IMAGES)
    return ticks, updates


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()

    ours, numpy_times = state_estimation(Config())
    loop_rows = []
    for each in (load_config(profile="paper"), load_config(profile="best")):
        tick, update = in_operation(each)
        for what, times, goal in (
            ("control tick", tick, 1000.0),
            ("control tick without images", control_tick(each), 1000.0),
            ("image update", update, 30_000.0),
        ):
            loop_rows.append(goal_row(what, "ns", times, goal, profile=each.profile))
    eight = control_tick(axes(8, width_limit=1.2))
    what = "tick of 8 DOFs without images"
    loop_rows.append(goal_row(what, "ns", eight, 2500.0, profile="best"))
    ratio = [theirs / own for theirs, own in zip(numpy_times, ours, strict=True)]
    rows = [
        *loop_rows,
        goal_row("state estimation, Eqs. (9)-(16)", "ns", ours, 2000.0),
        goal_row("NumPy pinv over state estimation", "ratio", ratio, 10.0, "min"),
    ]
    if arguments.json:
        print(json.dumps({"rows": rows, "numpy_pinv_ns": statistics.median(numpy_times)}))
        return
    print_rows(rows)
    print(f"NumPy's pinv alone: {statistics.median(numpy_times):.0f} ns; {REPEATS} repeats each")


if __name__ == "__main__":
    main()
