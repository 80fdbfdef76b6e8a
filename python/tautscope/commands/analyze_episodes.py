"""``tautscope analyze`` of a data set with many episodes."""

import argparse
import os
import shlex
from collections.abc import Sequence
from functools import partial
from typing import Any

from tautscope.commands import arguments
from tautscope.commands.printing import console, print_json, progress_bar
from tautscope.runs.episodes import Episode
from tautscope.runs.output_folder import new_folder


def analyze_episodes(
    options: argparse.Namespace, episodes: Sequence[Episode], names: Sequence[str]
) -> None:
    """Judge all episodes; write episodes.csv and episodes.png, and print what they say."""
    import polars as pl  # noqa: PLC0415

    from tautscope.analysis.episodes import judge_all, judge_episode, summarize  # noqa: PLC0415
    from tautscope.analysis.output import episodes_figure  # noqa: PLC0415

    of_one = ("tip_file", "update_distance", "gain", "check", "config")
    arguments.refuse_unused(options, "--episode, of a data set", *of_one)
    folder = arguments.out_folder(options)
    pairs = tuple(zip(options.command, options.measured, strict=True))
    by_name = dict(zip(names, pairs, strict=True))
    judge_one = partial(judge_episode, options.file, by_name, options.time, options.missing)
    workers = options.workers or os.cpu_count() or 1
    rows: list[dict[str, Any]] = []
    with progress_bar("episodes") as progress:
        for done, each in enumerate(judge_all(episodes, judge_one, workers), 1):
            rows += each
            progress(done / len(episodes))
    with new_folder(folder) as place:
        pl.DataFrame(rows, infer_schema_length=None).write_csv(place / "episodes.csv")
        episodes_figure(rows, names).savefig(place / "episodes.png")
    found = {name: summarize([row for row in rows if row["name"] == name]) for name in names}
    dofs = [
        {"name": name, "command": command, "measured": tip} | found[name]
        for name, (command, tip) in zip(names, pairs, strict=True)
    ]
    print_json(options, {"folder": str(folder), "episodes": len(episodes), "dofs": dofs})
    screen = console()
    for name, (command, tip) in zip(names, pairs, strict=True):
        text = f"{name}: {_text(found[name], len(episodes))}"
        if (typical := found[name]["typical"]) is not None:
            words = ["tautscope", "analyze", options.file, "--episode", str(typical)]
            more = shlex.join([*words, "--command", command, "--measured", tip])
            text += f" A compensator, from the episode with the median: {more}"
        screen.print(f"{text}\n", soft_wrap=True)
    screen.print(f"All episodes: {folder / 'episodes.csv'}, episodes.png", soft_wrap=True)


def _text(found: dict[str, Any], count: int) -> str:
    parts = [f"the slack is identified in {found['identified']} of {count} episodes"]
    if found["identified"]:
        between = ""
        if found["low"] is not None:
            between = f" ({found['low']:.3g} to {found['high']:.3g}, 95 % interval of the median)"
        parts[0] += (
            f": median {found['median']:.3g}{between}, "
            f"{found['tenth']:.3g} to {found['ninetieth']:.3g} in 80 % of them"
        )
    if found["aligned"]:
        parts.append(f"In {found['aligned']} it is 0")
    parts += [
        f"Not in {reason['count']}, such as episode {reason['episode']}: {reason['missing']}"
        for reason in found["reasons"]
    ]
    return ". ".join(parts) + "."
