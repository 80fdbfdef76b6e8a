"""What profile `best` takes out of the slack beside profile `paper`, on the twin.

Every figure is the median of the seeds with the worst beside it, with camera images as the only
feedback. `--write` makes docs/hysteresis.md, its figures and the README's table from it.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import hysteresis_ablation as ablation
import hysteresis_table as tables
from hysteresis_goals import GOALS
from hysteresis_rows import SCENARIOS, Plan
from hysteresis_runs import Recordings, Store
from tautscope.commands.progress import progress_bar
from tautscope.config import Config, Profile, load_config
from tautscope.dof import Dof

PROFILES: tuple[Profile, ...] = ("paper", "best")
SEEDS = range(5)
"""Of the tables."""
WITHOUT_IDEA = ("alone", "together", "changing", "too wide", "tremor")
"""The groups an ablation runs unless told otherwise."""
ABLATION_SEEDS = range(100, 103)
"""Of an ablation, whose runs take true features with noise in place of images: what it compares
is the law and the offsets."""

Work = dict[tuple[str, str, int], Plan]
"""Group of rows, name of the configuration, seed: the runs."""


def plan(
    configs: Mapping[str, Config], groups: Sequence[str], seeds: Sequence[int], images: bool
) -> Work:
    """All that is to be run."""
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


def measure(store: Store, work: Work) -> tables.Figures:
    """All figures of finished runs."""
    figures: dict[tuple[str, Dof, str], dict[int, float]] = defaultdict(dict)
    for (group, name, seed), runs in work.items():
        for what, dof, value in SCENARIOS[group].figures(store.open(runs)):
            scale = dof.display_scale if GOALS[what].unit == "tip" else 1.0
            figures[what, dof, name][seed] = scale * float(value)
    return tables.pair(figures)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout, no more")
    parser.add_argument("--seeds", type=int, help="how many [5; of an ablation 3]")
    parser.add_argument("--first-seed", type=int, help="[0; of an ablation 100]")
    parser.add_argument("--features", action="store_true", help="true features, not images: fast")
    parser.add_argument("--profile", choices=PROFILES, help="only this one [both]")
    parser.add_argument("--only", choices=SCENARIOS, action="append", help="only this group [all]")
    parser.add_argument("--config", metavar="FILE", help="TOML file")
    parser.add_argument(
        "--ablation", action="store_true", help="profile best without each of its ideas in turn"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="[all cores]")
    parser.add_argument(
        "--cache", type=Path, metavar="DIR", help="keep finished runs, and use them"
    )
    parser.add_argument("--write", action="store_true", help="make the documentation's tables")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="draw the figures there")
    options = parser.parse_args()
    usual = ABLATION_SEEDS if options.ablation else SEEDS
    options.features |= options.ablation
    options.seeds = options.seeds or len(usual)
    options.first_seed = usual.start if options.first_seed is None else options.first_seed
    if options.write and (options.only or options.profile):
        parser.error("--write makes whole tables: not with --only or --profile")
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
    groups = options.only or (WITHOUT_IDEA if options.ablation else list(SCENARIOS))
    work = plan(configs, groups, seeds, images=not options.features)
    with progress_bar("hysteresis") as tell:
        runs = [each for part in work.values() for each in part.values()]
        store.simulate(runs, options.workers, tell)
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
    """Draw the figures; with `--write`, make the documentation's tables too."""
    # Matplotlib is loaded by those who draw.
    import hysteresis_figures as figures  # noqa: PLC0415
    import hysteresis_pages as pages  # noqa: PLC0415

    if options.ablation:
        pages.write_ablation(ablation.table(ablation.compare(rows)), made(options))
        return

    def load(group: str) -> figures.Finished:
        found: dict[int, dict[str, Recordings]] = defaultdict(dict)
        for (each, name, seed), runs in work.items():
            if each == group:
                found[seed][name] = store.open(runs)
        return figures.Finished(found)

    drawn = figures.draw(options.figures or pages.FOLDER, {group for group, _, _ in work}, load)
    if options.write:
        pages.write_tables(rows, drawn, made(options))


def made(options: argparse.Namespace) -> str:
    """Of what the tables are."""
    first, last = options.first_seed, options.first_seed + options.seeds - 1
    seeds = f"Seed {first}" if first == last else f"Seeds {first} to {last}"
    source = "true features with noise" if options.features else "camera images"
    return f"{seeds}, {source}, median (worst)."


if __name__ == "__main__":
    main()
