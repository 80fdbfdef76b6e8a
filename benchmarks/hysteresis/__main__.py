"""Hysteresis that profiles `best` and `paper` leave, on the twin.

Every value is the median over the seeds, with the worst seed. Camera images are the only feedback.
`--write` updates docs/hysteresis.md and its figures.
"""

import argparse
import json
import sys
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.processes import add_arguments
from hysteresis import ablation, tables
from hysteresis.goals import GOALS
from hysteresis.scenarios import SCENARIOS, Plan
from hysteresis.store import Recordings, Store
from tautscope.commands.printing import progress_bar
from tautscope.config import Config, Profile, load_config
from tautscope.dof import Dof

PROFILES: tuple[Profile, ...] = ("paper", "best")
SEEDS = range(5)
"""Seeds of the tables."""
ABLATION_SCENARIOS = ("operator", "alone", "together", "changing", "too wide", "tremor")
"""Scenarios of an ablation, by default."""
ABLATION_SEEDS = range(100, 103)
"""Seeds of an ablation. It compares the control law and the offsets, with features for images."""

Work = dict[tuple[str, str, int], Plan]
"""Scenario, name of the configuration, seed: the runs."""


def plan(
    configs: Mapping[str, Config], groups: Sequence[str], seeds: Sequence[int], images: bool
) -> Work:
    """Return all runs."""
    work: Work = {}
    for name, config in configs.items():
        for group in groups:
            scenario = SCENARIOS[group]
            for seed in seeds if config.profile in scenario.profiles else ():
                runs = scenario.plan(config.replace(**{"twin.seed": seed}))
                work[group, name, seed] = {
                    key: replace(each, images=images) for key, each in runs.items()
                }
    return work


def measure(store: Store, work: Work) -> tables.Values:
    """Measure all finished runs."""
    values: dict[tuple[str, Dof, str], dict[int, float]] = defaultdict(dict)
    for (group, name, seed), runs in work.items():
        for what, dof, value in SCENARIOS[group].measure(store.open(runs)):
            scale = dof.display_scale if GOALS[what].unit == "tip" else 1.0
            values[what, dof, name][seed] = scale * float(value)
    return tables.pair(values)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--seeds", type=int, help="number of seeds [5; of an ablation 3]")
    parser.add_argument("--first-seed", type=int, help="[0; of an ablation 100]")
    parser.add_argument(
        "--features", action="store_true", help="true features in place of images: fast"
    )
    parser.add_argument("--profile", choices=PROFILES, help="only this profile [both]")
    parser.add_argument(
        "--only", choices=SCENARIOS, action="append", help="only this scenario [all]"
    )
    parser.add_argument("--config", metavar="FILE", help="TOML file")
    parser.add_argument(
        "--ablation", action="store_true", help="profile best without each of its ideas in turn"
    )
    add_arguments(parser)
    parser.add_argument(
        "--cache", type=Path, metavar="DIR", help="store finished runs, and reuse them"
    )
    parser.add_argument(
        "--write", action="store_true", help="update the tables of the documentation"
    )
    parser.add_argument("--figures", type=Path, metavar="DIR", help="folder for the figures")
    options = parser.parse_args()
    default = ABLATION_SEEDS if options.ablation else SEEDS
    options.features |= options.ablation
    options.seeds = options.seeds or len(default)
    options.first_seed = default.start if options.first_seed is None else options.first_seed
    if options.write and (options.only or options.profile):
        parser.error("--write updates whole tables: use it without --only and --profile")
    return options


def main() -> None:
    options = arguments()
    with tempfile.TemporaryDirectory() as scratch:
        run(options, Store(options.cache or Path(scratch)))


def run(options: argparse.Namespace, store: Store) -> None:
    if options.ablation:
        best = load_config(options.config, "best")
        configs = {"best": best} | {
            name: best.replace(**changes) for name, changes in ablation.IDEAS.items()
        }
    else:
        profiles: Sequence[Profile] = [options.profile] if options.profile else PROFILES
        configs = {name: load_config(options.config, name) for name in profiles}
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    groups = options.only or (ABLATION_SCENARIOS if options.ablation else list(SCENARIOS))
    work = plan(configs, groups, seeds, images=not options.features)
    with progress_bar("hysteresis") as show_progress:
        runs = [each for part in work.values() for each in part.values()]
        store.simulate(runs, options.workers, show_progress, options.scheduler)
    rows = tables.to_rows(measure(store, work))
    facts = {"images": not options.features, "seeds": list(seeds)}
    if options.ablation:
        losses = ablation.compare(rows)
        print(json.dumps({"ablation": losses, **facts}) if options.json else ablation.table(losses))
    else:
        print(tables.to_json(rows, **facts) if options.json else tables.plain(rows))
    if options.write or (options.figures and not options.ablation):
        publish(options, store, work, rows)


def publish(
    options: argparse.Namespace, store: Store, work: Work, rows: Sequence[tables.Row]
) -> None:
    """Draw the figures; with `--write`, update the tables of the documentation too."""
    # Only drawing loads Matplotlib.
    from hysteresis import figures, pages  # noqa: PLC0415
    from hysteresis.loop_figures import Finished  # noqa: PLC0415

    if options.ablation:
        pages.write_ablation(ablation.table(ablation.compare(rows)), conditions(options))
        return

    def load(group: str) -> Finished:
        found: dict[int, dict[str, Recordings]] = defaultdict(dict)
        for (each, name, seed), runs in work.items():
            if each == group:
                found[seed][name] = store.open(runs)
        return Finished(found)

    drawn = figures.draw(options.figures or pages.FOLDER, {group for group, _, _ in work}, load)
    if options.write:
        pages.write_tables(rows, drawn, conditions(options))


def conditions(options: argparse.Namespace) -> str:
    """Describe the seeds and the feedback of the tables."""
    first, last = options.first_seed, options.first_seed + options.seeds - 1
    seeds = f"Seed {first}" if first == last else f"Seeds {first} to {last}"
    source = "true features with noise" if options.features else "camera images"
    return f"{seeds}, {source}, median"


if __name__ == "__main__":
    main()
