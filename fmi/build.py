"""Builds the FMI 3.0 co-simulation units: the simulated instrument, and the loop.

``uv run --group fmi fmi/build.py twin|loop --out FILE [--config FILE]``. A C compiler is needed,
for the loop also ``cargo build --package tautscope-ffi --release``.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from hashlib import sha256
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree import ElementTree

from tautscope import Config, TautscopeError, __version__, load_config
from tautscope.config import dump_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError

try:
    import fmpy
    from fmpy.validation import validate_fmu
except ModuleNotFoundError:
    raise SystemExit("error: FMPy is not installed. First run: uv sync --group fmi") from None

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
COORDINATES = ("a_x", "a_y", "b_x", "b_y")
LIBRARIES = ("-lpthread", "-ldl", "-lm")
TIME_LIMIT = 60
"""How long `twin.c` waits for an answer of its process [s], and 1 s more per control period.

On a busy computer a start takes a tenth of it, most of it for imports.
"""


class Variable(NamedTuple):
    """A variable of a unit; its index is its value reference. `*` is every degree of freedom."""

    name: str
    role: Literal["time", "input", "fixed", "tunable", "output"]
    description: str
    unit: str = ""
    start: float | bool | str = 0.0
    group: str = ""
    """The name before `*`: the first one's in C."""

    @property
    def type(self) -> str:
        """The element of the model description."""
        return {bool: "Boolean", int: "Int32", str: "String"}.get(type(self.start), "Float64")


def measured(role: Literal["input", "output"]) -> list[Variable]:
    """What an image contributes; of a robot with [[dof]], what its sensor does."""
    band = "Centroid of a marker band; NaN if it was not found"
    return [
        Variable("has_image", role, "Whether an image has arrived since the last step", "", False),
        Variable("has_measured", role, "Whether it was measured since the last step", "", False),
        Variable("captured_at", role, "When the last image or measurement was taken", "s"),
        Variable("measured_*", role, "Position of the tip; NaN: not measured"),
        *(Variable(f"features_{name}", role, band, "px") for name in COORDINATES),
    ]


TIME = Variable("time", "time", "Time of the simulation", "s")
TWIN = [
    TIME,
    Variable("command_*", "input", "Command to the drives"),
    Variable("seed", "fixed", "Random seed: another instrument", "", 0),
    Variable(
        "has_camera", "fixed", "Whether there are images; without them it is faster", "", True
    ),
    Variable("python", "fixed", "Python interpreter with tautscope[twin]", "", sys.executable),
    Variable("applied_*", "output", "Position that the drives report"),
    Variable("true_*", "output", "State of the tip"),
    *measured("output"),
]
"""`twin.c` expects the outputs together, as `twin_process.py` sends them."""

LOOP = [
    TIME,
    Variable("reference_*", "input", "Reference of the operator"),
    Variable("reference_age", "input", "Time since the reference was made; NaN: not known", "s"),
    *measured("input"),
    Variable("engage", "input", "Rising edge: resume held motion", "", False),
    Variable("acknowledge", "input", "Rising edge: acknowledge warnings", "", False),
    Variable("drive_fault", "input", "Rising edge: a drive has failed", "", False),
    Variable("compensation", "tunable", "Share of the compensation in use, 0 to 1", "", 1.0),
    Variable("command_*", "output", "Command to the drives"),
    Variable("delta_minus_*", "output", "Negative contact offset"),
    Variable("delta_plus_*", "output", "Positive contact offset"),
    Variable("estimate_*", "output", "State estimate; NaN: not known"),
    Variable("status", "output", "Result of the last update, a TautscopeStatus; at first 3", "", 0),
    Variable("reaction", "output", "From 6 on the drives must stop; a TautscopeReaction", "", 0),
    Variable("flags", "output", "Active flags, a bit 1 << TautscopeFlag each", "", 0),
]
UNITS = {"twin": TWIN, "loop": LOOP}
DESCRIPTIONS = {
    "twin": "Simulated flexible endoscopic instrument with hysteresis and a camera",
    "loop": "Hysteresis compensation for robotic flexible instruments",
}
CAUSALITY = {
    "time": ("independent", "continuous"),
    "input": ("input", "discrete"),
    "fixed": ("parameter", "fixed"),
    "tunable": ("parameter", "tunable"),
    "output": ("output", "discrete"),
}


def variables_of(kind: str, config: Config) -> list[Variable]:
    """The variables of a unit, of the degrees of freedom and the sensor of the configuration."""
    if config.dof and kind == "twin":
        names = [dof.name for dof in config.dof]
        raise ConfigError("dof", names, "none: the twin is the article's instrument")
    absent = ("has_image", "features_") if config.dof else ("has_measured", "measured_")
    # An input that is not connected moves nothing: the twin starts here.
    rest = {} if config.dof else {dof.label: config.experiment[dof].centre for dof in Dof}
    variables: list[Variable] = []
    for each in UNITS[kind]:
        group, star, _ = each.name.partition("_*")
        for dof in config.dofs if star else ():
            unit = "m" if dof.display_unit == "mm" else "rad"
            start = rest.get(dof.label, 0.0) if each.role == "input" else each.start
            name = f"{group}_{dof.label}"
            variables.append(each._replace(name=name, unit=unit, start=start, group=group))
        variables += [] if star else [each]
    variables = [each for each in variables if not each.name.startswith(absent)]
    names = [variable.name for variable in variables]
    for index, dof in enumerate(config.dof):
        if any(names.count(name) > 1 for name in names if name.endswith(f"_{dof.name}")):
            allowed = "a name that does not make two variables equal, as reference_age"
            raise ConfigError(f"dof[{index}].name", dof.name, allowed)
    return variables


def token(kind: str, config: Config) -> str:
    """The instantiation token: another one for other variables or another configuration."""
    return sha256(f"{variables_of(kind, config)}{dump_config(config)}".encode()).hexdigest()[:32]


def start_text(variable: Variable) -> str:
    """A start value in XML."""
    return str(variable.start).lower() if variable.type == "Boolean" else str(variable.start)


def model_description(kind: str, config: Config) -> bytes:
    """The unit's modelDescription.xml."""
    variables, name = variables_of(kind, config), f"tautscope_{kind}"
    period = repr(config.control.period)
    root = ElementTree.Element("fmiModelDescription", fmiVersion="3.0", modelName=name)
    root.attrib |= {"instantiationToken": token(kind, config), "version": __version__}
    root.attrib |= {"description": DESCRIPTIONS[kind], "generationTool": "tautscope"}
    ElementTree.SubElement(root, "CoSimulation", modelIdentifier=name, fixedInternalStepSize=period)
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in variables} - {""}):
        element = ElementTree.SubElement(units, "Unit", name=unit)
        if unit != "px":
            ElementTree.SubElement(element, "BaseUnit", {unit: "1"})
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stepSize=period)
    declarations = ElementTree.SubElement(root, "ModelVariables")
    structure = ElementTree.SubElement(root, "ModelStructure")
    outputs = [str(i) for i, variable in enumerate(variables) if variable.role == "output"]
    for reference in outputs:
        ElementTree.SubElement(structure, "Output", valueReference=reference)
    for reference in outputs:
        ElementTree.SubElement(structure, "InitialUnknown", valueReference=reference)
    for reference, variable in enumerate(variables):
        causality, variability = CAUSALITY[variable.role]
        element = ElementTree.SubElement(declarations, variable.type, name=variable.name)
        element.attrib |= {"valueReference": str(reference), "description": variable.description}
        element.attrib |= {"causality": causality, "variability": variability}
        if variable.unit:
            element.set("unit", variable.unit)
        if variable.type == "String":
            ElementTree.SubElement(element, "Start", value=start_text(variable))
        elif variable.role not in ("time", "output"):
            element.set("start", start_text(variable))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)


def quoted(text: str) -> str:
    """A string of C."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def header(kind: str, config: Config) -> str:
    """`variables.h` of `unit.c`: indices, types, roles and start values."""
    variables = variables_of(kind, config)
    first = {v.group or v.name: index for index, v in reversed(list(enumerate(variables)))}
    names = ", ".join(f"{name.upper()} = {index}" for name, index in first.items())
    rows = ", ".join(
        f"{{{v.type.upper()}, {v.role.upper() if v.role != 'time' else 'OUTPUT'}, "
        f"{0.0 if v.type == 'String' else float(v.start)!r}}}"
        for v in variables
    )
    text = next((str(v.start) for v in variables if v.type == "String"), "")
    outputs = sum(variable.role == "output" for variable in variables)
    return (
        f"enum {{ {names}, VARIABLES = {len(variables)} }};\n"
        "enum { NONE, FLOAT64, INT32, BOOLEAN, STRING };\n"
        "enum { INPUT, FIXED, TUNABLE, OUTPUT };\n"
        f"#define OUTPUTS {outputs}\n"
        f"#define VARIABLE_TABLE {{{rows}}}\n"
        f"#define START_TEXT {quoted(text)}\n"
        f"#define PERIOD {config.control.period!r}\n"
        f"#define TIME_LIMIT {TIME_LIMIT}\n"
        f"#define INSTANTIATION_TOKEN {quoted(token(kind, config))}\n"
    )


def compile_unit(kind: str, config: Config, folder: Path) -> Path:
    """Compile the unit's library into a folder."""
    (folder / "variables.h").write_text(header(kind, config), encoding="utf-8")
    library = folder / (f"tautscope_{kind}" + (".dylib" if sys.platform == "darwin" else ".so"))
    includes = [folder, HERE, Path(fmpy.__file__).parent / "c-code", ROOT / "crates/ffi/include"]
    compiler = os.environ.get("CC", "cc")
    if shutil.which(compiler) is None:
        raise ConfigError("CC", compiler, "a C compiler")
    command = [compiler, "-std=c99", "-O2", "-shared", "-fPIC"]
    command += ["-fvisibility=hidden", "-Wall", "-Wextra", "-Werror"]
    command += [f"-I{include}" for include in includes]
    command += [str(HERE / name) for name in ("unit.c", "unsupported.c", f"{kind}.c")]
    command += ["-o", str(library)]
    if kind == "loop":
        archive = ROOT / "target" / "release" / "libtautscope.a"
        if not archive.is_file():
            first = "cargo build --package tautscope-ffi --release"
            raise SystemExit(f"error: File not found: {archive}. First run: {first}")
        command += [str(archive), *([] if sys.platform == "darwin" else ["-Wl,--exclude-libs,ALL"])]
    subprocess.run([*command, *LIBRARIES], check=True)
    return library


def build(kind: str, out: Path, config: Config) -> None:
    """Write a unit.

    Args:
        kind: ``twin`` or ``loop``.
        out: The file to write, ``*.fmu``.
        config: Becomes part of the unit.
    """
    machine = {"AMD64": "x86_64", "arm64": "aarch64"}.get(platform.machine(), platform.machine())
    system = "darwin" if sys.platform == "darwin" else "linux"
    with tempfile.TemporaryDirectory() as folder:
        library = compile_unit(kind, config, Path(folder))
        written = Path(folder) / out.name
        with zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", model_description(kind, config))
            archive.write(library, f"binaries/{machine}-{system}/{library.name}")
            archive.writestr("resources/config.toml", dump_config(config))
            if kind == "twin":
                archive.write(HERE / "twin_process.py", "resources/twin_process.py")
        if problems := validate_fmu(str(written)):
            raise SystemExit("error: " + "\n".join(problems))
        out.write_bytes(written.read_bytes())


def main() -> None:
    parser = argparse.ArgumentParser(description="Build an FMI 3.0 co-simulation unit.")
    parser.add_argument("kind", choices=UNITS, help="the simulated instrument, or the loop")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the .fmu to write")
    parser.add_argument("--config", metavar="FILE", help="TOML file; missing keys are the defaults")
    options = parser.parse_args()
    if options.out.is_dir() or not options.out.absolute().parent.is_dir():
        parser.error(f"--out: got {options.out}, expected a file in a folder that exists")
    try:
        build(options.kind, options.out, load_config(options.config))
    except TautscopeError as error:
        parser.error(str(error))
    except subprocess.CalledProcessError as error:
        parser.error(f"CC: {error.cmd[0]} ended with status {error.returncode}: see its messages")
    except OSError as error:
        parser.error(f"--out: {error}")
    print(options.out)


if __name__ == "__main__":
    main()
