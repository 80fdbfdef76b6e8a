"""The packages agree with themselves: what they use is declared, and what is named exists."""

import ast
import re
import runpy
import sys
import tomllib
from pathlib import Path
from unittest.mock import MagicMock
from xml.etree import ElementTree

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[2]
ROS = ROOT / "ros"
PACKAGES = {path.parent.name: path for path in ROS.glob("*/package.xml")}
VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["package"]["version"]
CONTROL = ROS / "tautscope_control"
WITH_ANOTHER_NAME = {"tautscope": "tautscope_vendor"}
"""CMake package -> the package that has it."""
JOINTS = ["insertion", "rotation", "bending"]


def declared(package: str) -> set[str]:
    root = ElementTree.parse(PACKAGES[package]).getroot()
    return {str(each.text) for each in root if each.tag.endswith("depend")}


def imported(*files: Path) -> set[str]:
    """Packages that Python files import."""
    names = set()
    for file in files:
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                names |= {each.name.split(".")[0] for each in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(str(node.module).split(".")[0])
    return names - set(sys.stdlib_module_names)


def test_there_are_three_packages():
    assert set(PACKAGES) == {"tautscope_control", "tautscope_node", "tautscope_vendor"}


@pytest.mark.parametrize("package", sorted(PACKAGES))
def test_a_package_has_the_name_of_its_folder_and_the_version_of_the_repository(package):
    root = ElementTree.parse(PACKAGES[package]).getroot()
    assert (root.get("format"), root.findtext("name")) == ("3", package)
    assert root.findtext("version") == VERSION
    if (setup := PACKAGES[package].with_name("setup.py")).exists():
        assert f'version="{VERSION}"' in setup.read_text("utf-8")


def test_the_python_package_declares_what_it_imports():
    folder = ROS / "tautscope_node"
    used = imported(*folder.glob("tautscope_node/*.py"))
    assert used - declared("tautscope_node") == {"numpy", "tautscope", "tautscope_node"}


def test_the_cpp_package_declares_what_it_finds_and_includes():
    cmake = (CONTROL / "CMakeLists.txt").read_text("utf-8")
    (listed,) = re.findall(r"foreach\(package\s+([^)]*)\)", cmake)
    found = {WITH_ANOTHER_NAME.get(name, name) for name in listed.split()}
    assert found - {"Threads"} <= declared("tautscope_control")
    sources = [*CONTROL.glob("src/*.cpp"), *CONTROL.glob("include/*/*.hpp")]
    text = "\n".join(path.read_text("utf-8") for path in sources)
    included = set(re.findall(r"#include [<\"](\w+)/", text)) - {"tautscope_control"}
    assert included <= found


def test_the_part_without_ros_includes_nothing_of_it():
    for name in ("control_loop", "detection_exchange", "detection_worker"):
        for path in (
            CONTROL / "src" / f"{name}.cpp",
            CONTROL / "include/tautscope_control" / f"{name}.hpp",
        ):
            headers = re.findall(r"#include [<\"]([\w/.]+)[>\"]", path.read_text("utf-8"))
            assert all(
                "/" not in header or header.startswith("tautscope_control/") for header in headers
            )


def launch_files(package: str) -> set[Path]:
    """The launch files that a package installs."""
    cmake = (CONTROL / "CMakeLists.txt").read_text("utf-8")
    shared = re.findall(r"install\(FILES (\S+\.launch\.py) DESTINATION", cmake)
    files = set((ROS / package / "launch").glob("*.py"))
    if package == CONTROL.name:
        files |= {(CONTROL / path).resolve(strict=True) for path in shared}
    return files


@pytest.mark.parametrize("package", ["tautscope_control", "tautscope_node"])
def test_the_launch_file_starts_the_node_of_the_package_it_is_installed_with(
    package, tmp_path, monkeypatch
):
    (source,) = (path for path in launch_files(package) if path.name == "node.launch.py")
    for name in imported(source):
        for module in re.findall(rf"from ({name}[\w.]*) import", source.read_text("utf-8")):
            monkeypatch.setitem(sys.modules, module, MagicMock())
    sys.modules["launch.substitutions"].LaunchConfiguration = "value of {}".format
    path = tmp_path / "share" / package / "launch" / source.name
    path.parent.mkdir(parents=True)
    path.write_bytes(source.read_bytes())
    runpy.run_path(str(path))["generate_launch_description"]()
    (node,) = sys.modules["launch_ros.actions"].LifecycleNode.call_args_list
    assert (node.kwargs["package"], node.kwargs["executable"]) == (package, "instrument_node")

    # Every parameter can be given, by a file of the package unless there is another.
    parameters = ["value of params_file", {"config": "value of config"}]
    assert node.kwargs["parameters"] == parameters
    declared = sys.modules["launch.actions"].DeclareLaunchArgument.call_args_list
    defaults = {call.args[0]: call.kwargs.get("default_value") for call in declared}
    assert defaults["params_file"] == str(path.parents[1] / "config" / "node.yaml")
    build = "CMakeLists.txt" if package == CONTROL.name else "setup.py"
    assert "config/node.yaml" in (ROS / package / build).read_text("utf-8")


def test_parameter_files_are_for_the_node_and_have_its_parameters():
    page = (ROOT / "docs/interfaces/ros2_packages.md").read_text("utf-8")
    files = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    files.append((ROS / "tautscope_node/config/node.yaml").read_text("utf-8"))
    declared = re.findall(r'declare\("(\w+)"', (CONTROL / "src/session.cpp").read_text("utf-8"))
    for text in files:
        (heading, content), *others = YAML(typ="safe").load(text).items()
        # In any namespace: that of the node is an argument of the launch file.
        assert (heading, others) == ("/**", [])
        assert set(content["ros__parameters"]) <= set(declared)


def test_launch_files_use_what_is_declared():
    for package in ("tautscope_control", "tautscope_node"):
        for path in launch_files(package):
            text = path.read_text("utf-8")
            used = imported(path) | set(re.findall(r'package="(\w+)"', text))
            used |= set(re.findall(r'"(joint_state_broadcaster)",', text))
            assert used - {package} <= declared(package), path


def test_the_plugin_is_the_exported_class_and_the_type_of_the_controller():
    (plugin,) = ElementTree.parse(CONTROL / "controllers.xml").getroot().iter("class")
    source = (CONTROL / "src" / "controller.cpp").read_text("utf-8")
    (exported,) = re.findall(r"PLUGINLIB_EXPORT_CLASS\(([\w:]+), ([\w:]+)\)", source)
    assert (plugin.get("type"), plugin.get("base_class_type")) == exported
    assert f"type: {plugin.get('name')}\n" in (CONTROL / "config/controllers.yaml").read_text(
        "utf-8"
    )
    library = ElementTree.parse(CONTROL / "controllers.xml").getroot().get("path")
    assert f"add_library({library} SHARED" in (CONTROL / "CMakeLists.txt").read_text("utf-8")


def test_the_joints_are_the_same_everywhere():
    robot = ElementTree.parse(CONTROL / "urdf" / "instrument.urdf").getroot()
    assert [each.get("name") for each in robot.findall("joint")] == JOINTS
    hardware = robot.find("ros2_control")
    assert hardware is not None
    for joint, name in zip(hardware.findall("joint"), JOINTS, strict=True):
        assert joint.get("name") == name
        for kind in ("command_interface", "state_interface"):
            assert [each.get("name") for each in joint.findall(kind)] == ["position"]
    assert f"joints: [{', '.join(JOINTS)}]" in (CONTROL / "config/controllers.yaml").read_text(
        "utf-8"
    )
    names = ", ".join(f'"{joint}"' for joint in JOINTS)
    messages = CONTROL / "include/tautscope_control/messages.hpp"
    assert f"default_joints{{{names}}}" in messages.read_text("utf-8")
    assert f"[{names}]" in (ROS / "tautscope_node/tautscope_node/messages.py").read_text("utf-8")


def test_pixi_brings_every_dependency():
    manifest = tomllib.loads((ROS / "pixi.toml").read_text("utf-8"))
    brought = {
        name.removeprefix("ros-jazzy-").replace("-", "_") for name in manifest["dependencies"]
    }
    needed = set.union(*(declared(package) for package in PACKAGES))
    needed |= imported(*ROS.glob("test/*.py")) - {"conftest", "numpy", "record"}
    # launch and messages come with others; crtk_msgs has to be beside the packages.
    with_others = {"ament_index_python", "launch", "lifecycle_msgs", "rcl_interfaces"}
    assert needed - brought == {"crtk_msgs", *(with_others & needed), "tautscope_vendor"}
    tasks = manifest["tasks"]
    for task in tasks.values():
        assert set(task.get("depends-on", [])) <= set(tasks) if isinstance(task, dict) else True
