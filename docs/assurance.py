"""Write the files of each hazard into docs/safety.md, and docs/soup.md, for whoever assesses a rig.

``uv run docs/assurance.py``; tests/docs/test_assurance.py requires that both are up to date.
"""

import re
import tomllib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
FLAG_FILES = [
    file
    for file in sorted((ROOT / "crates" / "core" / "src").rglob("*.rs"))
    if file.name not in ("flags.rs", "reactions.rs")
]
CONTROLS = {
    "V12": ["python/tautscope/hardware/rig.py"],
    "V13": ["python/tautscope/hardware/video.py"],
    "V14": ["python/tautscope/hardware/plausibility.py"],
    "V15": ["python/tautscope/hardware/plausibility.py"],
    "E1": ["python/tautscope/config/control.py"],
    "E5": ["crates/core/src/article/play.rs", "crates/core/src/article/estimator.rs"],
    "E7": ["python/tautscope/config/section.py", "python/tautscope/config/checks.py"],
    "E8": ["crates/core/src/law/vector_law.rs"],
    "C2": ["crates/core/src/article/compensator.rs"],
    "C3": [
        "python/tautscope/loop/signal_checks.py",
        "crates/core/src/supervision/reference_gate.rs",
    ],
    "C4": ["crates/core/src/article/compensator.rs"],
    "D1": [
        "python/tautscope/hardware/cia402_drives.py",
        "python/tautscope/hardware/servos/servo_drives.py",
        "python/tautscope/hardware/serial_line/serial_drives.py",
    ],
    "D2": ["python/tautscope/hardware/canopen_master.py"],
    "D3": ["python/tautscope/hardware/following_error.py"],
    "D4": ["python/tautscope/hardware/commissioning.py"],
    "D5": [
        "python/tautscope/hardware/following_error.py",
        "python/tautscope/hardware/plausibility.py",
    ],
    "D6": ["python/tautscope/hardware/canopen_master.py"],
    "P1": ["python/tautscope/hardware/commissioning.py"],
    "P2": ["crates/core/src/lib.rs", "python/tautscope/hardware/drives.py"],
    "P3": ["python/tautscope/hardware/setpoint_thread.py"],
    "P4": ["python/tautscope/hardware/setpoint_thread.py"],
    "P5": ["crates/core/src/supervision/reference_gate.rs"],
    "L1": ["python/tautscope/log/journal.py"],
    "L2": ["python/tautscope/log/mcap_records.py"],
    "L3": ["python/tautscope/log/cdr.py", "python/tautscope/log/mcap_records.py"],
    "L4": ["python/tautscope/config/section.py"],
    "N1": ["python/tautscope/console/server.py", "python/tautscope/ros2/session.py"],
    "N2": ["python/tautscope/console/server.py", "python/tautscope/console/pages.py"],
    "N3": [
        "python/tautscope/console/operator_input.py",
        "python/tautscope/ros2/references.py",
    ],
    "N4": ["python/tautscope/console/session.py", "python/tautscope/console/rig_control.py"],
    "N5": ["python/tautscope/console/lease.py"],
    "M1": ["python/tautscope/hardware/rig_lock.py", "python/tautscope/console/lease.py"],
    "M2": ["python/tautscope/commands/console.py", "python/tautscope/twin/faults.py"],
    "H1": [
        "python/tautscope/console/operator_input.py",
        "python/tautscope/console/page/steer.js",
    ],
    "H2": ["python/tautscope/console/page/steer.js"],
    "C10": ["python/tautscope/config/checks.py"],
    "U1": ["python/tautscope/console/session_state.py"],
}
"""Hazard -> files of its control beyond those that raise the flags of its response."""
PURPOSE = {
    "numpy": "arrays at all interfaces",
    "msgspec": "types and ranges of the configuration",
    "tomlkit": "writing of TOML",
    "argcomplete": "completion in the shell",
    "scipy": "fits of `analyze`; not in the loop",
    "matplotlib": "figures",
    "polars": "tables of recorded positions; not in the loop",
    "rich": "tables and progress in a terminal",
    "mujoco": "physics of the twin; not in the loop",
    "opencv-python-headless": "images of the twin; PNG and JPEG of logs",
    "mcap": "records of logs",
    "ruamel.yaml": "camera_info files of ROS; not in the loop",
    "av": "camera sources and video files",
    "canopen": "SDO transfers and EDS files of drives",
    "python-can": "CAN frames: set-points, heartbeats, quick stop",
    "pyserial": "serial line to a microcontroller",
    "pysoem": "EtherCAT master",
    "rustypot": "packets of Dynamixel and Feetech servos",
    "dask": "benchmarks on a cluster",
    "rerun-sdk": "export of logs for the Rerun viewer",
    "eclipse-zenoh": "messages of ROS 2, in the process of the loop",
    "rosbags": "types, hashes and CDR of ROS 2; bags",
    "websockets": "web server of the console, in a process of its own",
}
"""Python package -> what this software uses it for."""
LICENCES = {"pysoem": "MIT License", "rerun-sdk": "MIT OR Apache-2.0", "rustypot": "Apache-2.0"}
"""Licence of packages that a clone does not install, or whose metadata do not name it."""

SOUP = """# Software of unknown provenance

The libraries of others in what a user runs, in the sense of IEC 62304. Versions are those of a
clone; `pyproject.toml` has the ranges. None of them is developed under a standard for medical
devices, nor is this software. Generated by `uv run docs/assurance.py`.

## Python packages

| package | version | licence | extras | used for |
|---|---|---|---|---|"""
CRATES = """
Each brings dependencies of its own; `uv tree --no-dev` lists them. Python itself is 3.11 or later.

## Rust crates in the extension module

`crates/core`, the loop, needs `libm` and `nalgebra` alone. All, with versions and licences, are in
the CycloneDX list of a wheel (`*.dist-info/sboms`), or in a clone:

```sh
cargo tree --package tautscope-bindings --edges normal --target all --format "{p} {l}"
```"""


def with_controls(page: str) -> str:
    """docs/safety.md with the files that implement the controls, and the hazards of each."""
    found: dict[str, list[str]] = {}
    for name, response in hazards(page):
        for file in control_files(name, response):
            found.setdefault(file, []).append(name)
    folders: dict[str, list[str]] = {}
    for file in sorted(found):
        folder, _, name = file.rpartition("/")
        folders.setdefault(folder, []).append(f"`{name}` {', '.join(found[file])}")
    lines = [f"- `{folder}`: {'; '.join(files)}" for folder, files in folders.items()]
    before, rest = page.split("<!-- controls: begin -->\n")
    after = rest.partition("<!-- controls: end -->")[2]
    table = "\n".join(lines)
    return f"{before}<!-- controls: begin -->\n{table}\n<!-- controls: end -->{after}"


def hazards(page: str) -> Iterator[tuple[str, str]]:
    """Name and response of each hazard in docs/safety.md."""
    for name, row in re.findall(
        r"^\| ([VECDPLNMUH]\d+) \| (.* \| .* \| .*) \|$", page, re.MULTILINE
    ):
        yield name, re.split(r" (?<!\\)\| ", row, maxsplit=2)[1]


def control_files(hazard: str, response: str) -> list[str]:
    """The files of a control, from the repository's root."""
    found = list(CONTROLS.get(hazard, []))
    for flag in re.findall(r"`([a-z_]+)`", response):
        variant = "Flag::" + "".join(word.capitalize() for word in flag.split("_"))
        found += [
            file.relative_to(ROOT).as_posix()
            for file in FLAG_FILES
            if re.search(rf"{variant}\b", file.read_text(encoding="utf-8"))
        ]
    return list(dict.fromkeys(found))


def soup() -> str:
    """docs/soup.md: the libraries of others that a user runs."""
    lines = [SOUP, *python_rows(), CRATES]
    return "\n".join(lines) + "\n"


def python_rows() -> Iterator[str]:
    """A row for each direct dependency of the package and its extras."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    pinned = dict(
        requirement.split("==") for requirement in document["tool"]["uv"]["constraint-dependencies"]
    )
    groups = {
        "": document["project"]["dependencies"],
        **document["project"]["optional-dependencies"],
    }
    extras: dict[str, list[str]] = {}
    for extra, requirements in groups.items():
        for requirement in requirements:
            name = re.split(r"[\[<>=]", requirement)[0]
            if name != "tautscope":
                extras.setdefault(name, []).append(extra)
    for name, members in extras.items():
        version = pinned.get(name, "not pinned")
        needed_by = ", ".join(members) or "base"
        yield f"| {name} | {version} | {python_licence(name)} | {needed_by} | {PURPOSE[name]} |"


def python_licence(name: str) -> str:
    """The licence of an installed package, as its metadata state it."""
    try:
        found = metadata(name)
    except PackageNotFoundError:
        return LICENCES[name]
    expression = found.get("License-Expression")
    classifiers = [
        line.rpartition(" :: ")[2]
        for line in found.get_all("Classifier") or []
        if line.startswith("License")
    ]
    return expression or ", ".join(classifiers) or LICENCES[name]


if __name__ == "__main__":
    safety = DOCS / "safety.md"
    safety.write_text(with_controls(safety.read_text(encoding="utf-8")), encoding="utf-8")
    (DOCS / "soup.md").write_text(soup(), encoding="utf-8")
