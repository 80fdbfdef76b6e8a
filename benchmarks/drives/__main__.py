"""Motors on a bus between two processes: punctuality of the set-points, and faults.

One process simulates the motors of a configuration (``bench``: CiA 402 drives; ``bench_dynamixel``,
``bench_feetech``, ``bench_serial``), this one controls them at 100 Hz, a sine of up to 1.5 rad/s on
each. The first part sends set-points for ``--seconds``. In the second, each fault happens
``--repeats`` times, at a random phase: which error ends the controller and when (it has told the
motors to hold before, and has asked a silent one to for a second), which motors still move, how far
and for how long, and when they stop by themselves. ``--realtime`` requests SCHED_FIFO for both.
"""

import argparse
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from drives.faults import FAULTS, UNKNOWN_ID, Fault
from drives.trial import Trial, trial
from tautscope.config import Config, DrivesConfig, from_document, load_config, to_document
from tautscope.dof import Dof


def with_motors(bench: Config, count: int) -> Config:
    """A robot of so many motors, each as that of rotation on the bench."""
    document = to_document(bench)
    names = [f"joint_{number}" for number in range(1, count + 1)]
    drives = document["drives"]
    own = drives["rotation"]
    for dof in Dof:
        del drives[dof.label]
    drives["motors"] = {name: own | {"node": at} for at, name in enumerate(names, start=1)}
    document["dof"] = [{"name": name, "width_limit": 1.0} for name in names]
    return from_document(document)


def drives_of(config: Config, **changes: Any) -> DrivesConfig:
    """The section of the drives, with changes."""
    drives = config.replace(**{f"drives.{name}": value for name, value in changes.items()}).drives
    assert drives is not None
    return drives


def run(bench: Config, fault: Fault | None = None, seconds: float = 60.0) -> Trial:
    """One trial on a bus of its own."""
    with tempfile.TemporaryDirectory() as folder:
        motors = drives_of(bench, channel=f"{folder}/bus")
        wrong = {"channel": motors.channel}
        if fault is not None and fault.wrong_node:
            wrong |= {f"motors.{motors.all_motors[1].label}.node": UNKNOWN_ID}
        happens = None if fault is None else fault.happens
        return trial(motors, drives_of(bench, **wrong), happens, seconds)


def streamed(bench: Config, seconds: float) -> dict[str, Any]:
    """Set-points for some time: how punctual they and their answers were."""
    said = run(bench, seconds=seconds).said[0]
    took, traffic = said["took"], said["traffic"]
    return {
        "set-points": traffic.cycles,
        "answers": traffic.cycles * len(traffic.lost),
        "lost": sum(traffic.lost),
        "late": sum(traffic.late),
        "answer_ms": [float(np.percentile(took, share)) for share in (50, 99, 100)],
        "longest_gap_ms": traffic.longest_pause * 1e3,
        "ended_by": said.get("message", ""),
    }


def repeated(bench: Config, fault: Fault, repeats: int) -> dict[str, Any]:
    """The worst of some trials of a fault."""
    assert bench.drives is not None
    trials: list[Trial] = []
    disturbed = 0
    while len(trials) < repeats:
        found = run(bench, fault)
        if found.is_disturbed:
            disturbed += 1
        else:
            trials.append(found)
    moved = np.array([each.moved()[0] for each in trials])
    ended = [each.said[fault.speaker] for each in trials]
    times = [
        one["at"] - each.happened for one, each in zip(ended, trials, strict=True) if "at" in one
    ]
    stops = np.array([each.stopped() for each in trials])
    has_stopped = np.isfinite(stops)
    return {
        "what": fault.what,
        "right": sum(fault.is_right(each, bench.drives.protocol) for each in trials),
        "of": repeats,
        "disturbed": disturbed,
        "ended": dict(Counter(one.get("error", "") for one in ended)),
        "said": next((one["message"] for one in ended if "message" in one), ""),
        "error_ms": 1e3 * max(times) if times else None,
        "moves_ms": 1e3 * max(each.moved()[1] for each in trials),
        "far": float(moved[:, 1].max()),
        "far_others": float(np.delete(moved, 1, axis=1).max()),
        "stop_ms": 1e3 * float(stops[has_stopped].max()) if has_stopped.any() else None,
        "never": int((~has_stopped).any(axis=1).sum()) if fault.is_silent else 0,
    }


def tables(document: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of both tables."""
    if found := document.get("streamed"):
        yield "| set-points | answers lost | late | median, 99 %, latest answer | longest gap |"
        yield "|--:|--:|--:|--:|--:|"
        answer = ", ".join(f"{each:.2g}" for each in found["answer_ms"])
        yield (
            f"| {found['set-points']} | {found['lost']} of {found['answers']} | {found['late']} "
            f"| {answer} ms | {found['longest_gap_ms']:.3g} ms | {found['ended_by']}"
        )
    if rows := document.get("faults"):
        yield (
            "\n| event | as it must | ends with | error after | moves for | that motor, others "
            "| stop by themselves after |\n|---|--:|---|--:|--:|--:|--:|"
        )
        for row in rows:
            ends = ", ".join(f"{name or 'none'} {count}" for name, count in row["ended"].items())
            error, stop = (
                "" if row[key] is None else f"{row[key]:.0f} ms" for key in ("error_ms", "stop_ms")
            )
            never = f"{row['never']} never" if row["never"] else ""
            stop = ", ".join(filter(None, (stop, never)))
            yield (
                f"| {row['what']} | {row['right']} of {row['of']} | {ends} | {error} "
                f"| {row['moves_ms']:.0f} ms | {row['far']:.3f}, {row['far_others']:.3f} rad "
                f"| {stop} |"
                f"{' repeated: ' + str(row['disturbed']) if row['disturbed'] else ''}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--config", default="bench", help="bench, bench_dynamixel, ... [bench]")
    parser.add_argument("--motors", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=20, help="of each fault; 0 for none")
    parser.add_argument("--only", nargs="+", default=[""], help="faults with one of these texts")
    parser.add_argument("--seconds", type=float, default=20.0, help="of set-points; 0 for none")
    parser.add_argument("--heartbeat-timeout", type=float, help="[s] [that of the configuration]")
    parser.add_argument("--realtime", action="store_true")
    arguments = parser.parse_args()
    if arguments.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))  # children inherit it
    bench = load_config(arguments.config)
    if (timeout := arguments.heartbeat_timeout) is not None:
        bench = bench.replace(**{"drives.heartbeat_timeout": timeout})
    bench = with_motors(bench, arguments.motors)
    assert bench.drives is not None
    document: dict[str, Any] = {"cpus": os.cpu_count(), "load": os.getloadavg()}
    if arguments.seconds:
        document["streamed"] = streamed(bench, arguments.seconds)
    if arguments.repeats:
        document["faults"] = [
            repeated(bench, fault, arguments.repeats)
            for fault in FAULTS
            if bench.drives.protocol in fault.errors
            and any(text in fault.what for text in arguments.only)
        ]
    if arguments.json:
        print(json.dumps(document, indent=1))
        return
    for line in tables(document):
        print(line)


if __name__ == "__main__":
    main()
