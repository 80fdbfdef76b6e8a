"""Layers of the Rust crates: which file may use which, read from its `crate::` paths."""

import re
from collections import defaultdict
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter

import pytest
from common.paths import ROOT

CRATES = ROOT / "crates"
LAYERS = {
    "core": (
        {"math", "dof", "error", "settings"},
        {"model"},
        {"article"},
        {"estimation"},
        {"law"},
        {"supervision"},
        {"loop"},
    ),
    "vision": (
        {"math", "error", "settings"},
        {"scan"},
        {"recognition"},
        {"blur"},
        {"frame_search"},
        {"detector"},
    ),
}
"""From the lowest layer up; a file uses its own layer and those below."""
TESTS = re.compile(r"#\[cfg\(test\)\]\s*mod \w+ \{.*", re.DOTALL)
PATH = re.compile(r"\bcrate::((?:r#)?\w+(?:::(?:r#)?\w+)*)(?:::\{([^;]*?)\})?", re.DOTALL)


def sources(crate: str) -> dict[str, str]:
    """Text of each file by its module path: ``article/play``."""
    root = CRATES / crate / "src"
    return {
        path.relative_to(root).with_suffix("").as_posix().removesuffix("/mod"): path.read_text(
            encoding="utf-8"
        )
        for path in root.rglob("*.rs")
        if path.stem != "tests"
    }


def arrows(files: Mapping[str, str]) -> set[tuple[str, str]]:
    """Pairs of a file and one that it uses."""
    found = set()
    for name, text in files.items():
        if name == "lib":
            continue
        parent = "::".join(["crate", *name.split("/")[:-1]])
        for path, group in PATH.findall(TESTS.sub("", text).replace("super::", f"{parent}::")):
            for item in group.split(",") if group else [""]:
                parts = "/".join([*path.split("::"), *item.strip().split("::")])
                parts = parts.replace("r#", "").strip("/")
                while parts and parts not in files:
                    parts = parts.rpartition("/")[0]
                if parts and parts != name:
                    found.add((name, parts))
    return found


def circle(files: Mapping[str, str]) -> list[str]:
    """Files that use each other in a circle; none if there is no circle."""
    uses = defaultdict(list)
    for user, used in sorted(arrows(files)):
        uses[user].append(used)
    try:
        TopologicalSorter(uses).prepare()
    except CycleError as error:
        found: list[str] = error.args[1]
        return found
    return []


def violations(crate: str, files: Mapping[str, str]) -> list[str]:
    """Arrows from a layer to one above it."""
    rank = {room: place for place, rooms in enumerate(LAYERS[crate]) for room in rooms}
    return sorted(
        f"{user} uses {used}"
        for user, used in arrows(files)
        if rank[user.split("/")[0]] < rank[used.split("/")[0]]
    )


crates = pytest.mark.parametrize("crate", LAYERS)


@crates
def test_every_file_is_in_a_layer(crate: str) -> None:
    rooms = {name.split("/")[0] for name in sources(crate)} - {"lib"}
    assert rooms == set().union(*LAYERS[crate])


@crates
def test_no_file_uses_a_layer_above_its_own(crate: str) -> None:
    assert violations(crate, sources(crate)) == []


@crates
def test_no_files_use_each_other(crate: str) -> None:
    assert circle(sources(crate)) == []


@crates
def test_a_path_names_the_file_of_what_it_uses(crate: str) -> None:
    """A name that the crate's root re-exports would hide an arrow."""
    for name, text in sources(crate).items():
        assert name == "lib" or not re.search(r"^use crate::[A-Z{]", TESTS.sub("", text), re.M), (
            name
        )


def test_a_planted_violation_is_found() -> None:
    files = sources("core")
    files["math/linear"] += "use crate::model::camera::Camera;\n"
    assert violations("core", files) == ["math/linear uses model/camera"]
    assert set(circle(files)) == {"math/linear", "model/camera"}
