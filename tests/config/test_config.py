"""Configuration: defaults, files, and errors that name the key."""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.paths import ROOT
from tautscope.config import (
    Config,
    ControlConfig,
    DofConfig,
    ExperimentConfig,
    InstrumentConfig,
    Sine,
    TwinConfig,
    VisionConfig,
    axes,
    dump_config,
    from_document,
    load_config,
    to_document,
)
from tautscope.config.edit import edited_text
from tautscope.config.load import config_file
from tautscope.dof import Dof
from tautscope.errors import ConfigError, MissingPathError
from tautscope.loop.safety import disabled_monitors

CONFIGS = ROOT / "configs"


def loaded(tmp_path: Path, text: str) -> Config:
    file = tmp_path / "config.toml"
    file.write_text(text, encoding="utf-8")
    return load_config(file)


def test_defaults_are_the_articles_protocol() -> None:
    config = load_config()
    assert config.profile == Config().profile == "best"
    assert config.experiment.periods == 5
    for dof in Dof:
        assert config[dof].free_gain == 5.0
        assert config[dof].delta_minus == config[dof].delta_plus == 0.0


def test_a_written_configuration_reads_back_equal(tmp_path: Path) -> None:
    config = Config().replace(**{"twin.seed": 7, "insertion.free_gain": 3.5})
    assert loaded(tmp_path, dump_config(config)) == config


@pytest.mark.parametrize("file", sorted(CONFIGS.glob("*.toml")), ids=lambda file: file.name)
def test_the_files_in_configs_are_valid(file: Path) -> None:
    config = load_config(file)
    if config.dof:
        return
    assert config.drives is not None
    # `tautscope run` moves them through the article's references; each must fit the travel.
    for dof in Dof:
        lower, upper = config.drives[dof].travel
        sine = config.experiment[dof]
        assert lower < sine.centre - sine.amplitude < sine.centre + sine.amplitude < upper
        fastest = config[dof].free_gain * sine.amplitude * 2 * math.pi / sine.period
        assert fastest < config.drives[dof].speed_limit
    assert config.control.period == config.drives.cycle


def test_paths_are_relative_to_the_toml_file(tmp_path: Path) -> None:
    axis = "{node = %d, counts_per_unit = 1e4, sign = 1, travel = [0, 1], speed_limit = 1, "
    axis += "following_error = 0.1, following_window = 0.05, eds = '%s'}"
    names = [(1, "drive.eds"), (2, "../other/drive.eds"), (3, "/opt/drive.eds")]
    axes = [axis % each for each in names]
    dofs = ("insertion", "rotation", "bending")
    text = "\n".join(["[drives]", *(f"{dof} = {one}" for dof, one in zip(dofs, axes, strict=True))])
    config = loaded(tmp_path, text)
    if config.dof:
        return
    assert config.drives is not None
    for dof, (_, name) in zip(Dof, names, strict=True):
        assert Path(config.drives[dof].eds or "") == tmp_path / name
    (tmp_path / "elsewhere").mkdir()
    assert loaded(tmp_path / "elsewhere", dump_config(config)) == config


def test_missing_keys_have_their_defaults(tmp_path: Path) -> None:
    config = loaded(tmp_path, "[rotation]\nfree_gain = 4\n[camera.camera_from_guide]\n")
    assert config == Config().replace(**{"rotation.free_gain": 4.0})


@pytest.mark.parametrize(
    ("text", "field", "value"),
    [
        ("[insertion]\nfree_gian = 5", "insertion.free_gian", 5),
        ("colour = 1", "colour", 1),
        ("[rotation]\nfree_gain = 0.5", "rotation.free_gain", 0.5),
        ("[rotation]\nfree_gain = 6.0", "rotation.free_gain", 6.0),
        ("[bending]\nsmoothing_factor = 1.0", "bending.smoothing_factor", 1.0),
        ("[bending]\nupdate_distance = nan", "bending.update_distance", None),
        ("[bending]\ndelta_minus = 0.1", "bending.delta_minus", 0.1),
        ("[camera]\nwidth = '720'", "camera.width", "720"),
        ("[camera]\ncx = inf", "camera.cx", float("inf")),
        ("[camera]\ndistortion = [0.1]", "camera.distortion", [0.1]),
        ("[twin]\nseed = -1", "twin.seed", -1),
        ("[experiment]\nperiods = 2", "experiment.periods", 2),
        ("[experiment.bending]\namplitude = 0.0", "experiment.bending.amplitude", 0.0),
        ("[experiment.bending]\nperiod = 2.0", "experiment.bending.period", 2.0),
        ("[instrument]\nmarker_a = 14e-3", "instrument.marker_a", 14e-3),
        ("[instrument]\ntip_length = 16e-3", "instrument.marker_b", 16e-3),
        ("[control]\nperiod = 1e-4", "control.history", 2.0),
        ("insertion = 3", "insertion", 3),
    ],
)
def test_a_bad_value_is_named(tmp_path: Path, text: str, field: str, value: object) -> None:
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, text)
    assert error.value.field == field
    if value is not None:
        assert error.value.value == value
    assert error.value.allowed


def numbers(document: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted path and value of every number, and every list of numbers."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{above}{key}.")
        elif type(value) in (int, float) or (isinstance(value, list) and value):
            yield f"{above}{key}", value


SIGNED = {
    "camera.cx", "camera.cy", "camera.distortion", "camera.camera_from_guide.rotation",
    "camera.camera_from_guide.translation", "vision.weights", "vision.threshold",
    "vision.alternatives", "vision.unlocated.alternatives", "twin.shaft.set_angle",
    "experiment.insertion.centre", "experiment.bending.centre",
}  # fmt: skip
"""Numbers with a range of their own."""
LIMIT_NOTHING = ("safety.frozen_travel", "twin.seed")


@pytest.mark.parametrize("factor", [40.0, 57.3, 1e3, 1e6])
def test_no_limit_can_be_switched_off_by_a_wrong_unit_or_digit(factor: float) -> None:
    def times(value: Any) -> Any:
        return [times(one) for one in value] if isinstance(value, list) else factor * value

    accepted = []
    for path, value in numbers(to_document(Config())):
        if path in (*SIGNED, *LIMIT_NOTHING) or times(value) == value:
            continue
        whole = int(times(value)) if isinstance(value, int) else times(value)
        try:
            Config().replace(**{path: whole})
        except ConfigError as error:
            assert error.field.partition(".")[0] == path.partition(".")[0]
        else:
            accepted.append(path)
    assert accepted == []


@pytest.mark.parametrize(
    ("key", "value", "field"),
    [
        ("drives.insertion.speed_limit", 150.0, "drives.insertion.speed_limit"),
        ("drives.insertion.travel", [0.0, 60.0], "drives.insertion.travel"),
        ("drives.rotation.travel", [-4500.0, 4.5], "drives.rotation.travel"),
        ("camera.cy", 285e3, "camera.cy"),
        ("camera.camera_from_guide.translation", [13.5, 14, 15], "translation"),
        ("camera.camera_from_guide.rotation", [18.3, 0, 0], "rotation"),
        ("camera.distortion", [1e6, 0, 0, 0, 0, 0, 0, 0], "distortion"),
        ("vision.weights", [-525.0, 1000.0, -648.0], "vision.weights"),
        ("twin.latency", 80.0, "twin.latency"),
        ("kinematics.skew", 57.3, "kinematics.skew"),
        ("kinematics.base_position", [300.0, 0, 0], "base_position"),
        ("experiment.insertion.period", 1e4, "experiment.insertion.period"),
        ("measurement.position_deviation", 0.5, "measurement.position_deviation"),
    ],
)
def test_numbers_with_signs_and_those_of_motors_have_ranges(
    key: str, value: Any, field: str
) -> None:
    config = load_config(config_file("bench"))
    with pytest.raises(ConfigError, match=field):
        config.replace(**{key: value})


@pytest.mark.parametrize(("matrix", "most"), [((), 8.0), (((0.5, 0.5), (0.5, -0.5)), 8.0)])
def test_the_travel_of_a_motor_is_of_the_order_of_its_commands(
    matrix: tuple[tuple[float, float], ...], most: float
) -> None:
    """Of DOFs with commands of up to 0.8 rad."""
    document = to_document(axes(2, width_limit=0.4, unit="rad"))
    for dof in document["dof"]:
        dof["range"] = [-0.8, 0.8]
    motor = {"counts_per_unit": 1e4, "speed_limit": 1.0}
    names = [f"m_{n}" for n in (1, 2)] if matrix else [dof["name"] for dof in document["dof"]]
    if matrix:
        document["actuators"] = {"matrix": matrix, "names": names, "units": ["rad", "rad"]}
    for end, is_allowed in ((most * 0.99, True), (most * 1.01, False)):
        motors = {
            name: {**motor, "node": node, "travel": [-1.0, end]}
            for node, name in enumerate(names, 1)
        }
        document["drives"] = {"motors": motors}
        with nullcontext() if is_allowed else pytest.raises(ConfigError, match=r"m.*travel"):
            from_document(document)


@pytest.mark.parametrize(
    ("key", "value"),
    [("safety.stall", 1e4), ("safety.innovation_limit", 1e-3), ("law.change_rate", 1.0)],
)
def test_a_number_beyond_its_range_is_named_in_the_file_and_in_every_report(
    key: str, value: float
) -> None:
    with pytest.raises(ConfigError, match=f"{key} named in safety.unusual") as error:
        Config().replace(**{key: value})
    assert (error.value.field, error.value.value) == (key, value)
    config = Config().replace(**{key: value, "safety.unusual": [key]})
    assert any(key in line for line in disabled_monitors(config))
    assert disabled_monitors(Config()) == ()
    with pytest.raises(ConfigError, match=r"safety\.unusual\[0\]: got 'safety\.stal'"):
        Config().replace(**{"safety.unusual": ["safety.stal"]})


def test_a_missing_or_invalid_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"config: got '.*config\.toml', expected TOML"):
        loaded(tmp_path, "insertion = [")
    with pytest.raises(MissingPathError, match=r"File not found: .*none\.toml"):
        load_config(tmp_path / "none.toml")
    with pytest.raises(MissingPathError):
        load_config(tmp_path)


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000, "a = " + "{a = " * 5000, ".".join("a" * 5000) + " = 1"]
)
def test_a_file_nested_without_end_is_an_error(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="config: got"):
        loaded(tmp_path, text)
    with pytest.raises(ConfigError, match="config: got"):
        edited_text(text, {"twin.seed": 1})


def test_replace_checks_and_does_not_change_the_original() -> None:
    config = Config()
    with pytest.raises(ConfigError, match=r"twin\.seeds: got 1, expected no such key"):
        config.replace(**{"twin.seeds": 1})
    assert config == Config()
    with pytest.raises(AttributeError):
        config.twin.seed = 3  # type: ignore[misc]


@pytest.mark.parametrize("path", ["profile.x", "camera.fx.y", "dof.x"])
def test_replace_refuses_a_key_below_a_value(path: str) -> None:
    with pytest.raises(ConfigError, match=rf"{re.escape(path)}: got 1, expected no such key"):
        Config().replace(**{path: 1})


def test_a_tick_is_not_a_stall() -> None:
    changes = {"control.period": 0.1, "control.history": 2.0}
    with pytest.raises(ConfigError, match=r"safety\.stall: got 0\.1, expected at least 0\.2"):
        Config().replace(**changes)
    assert Config().replace(**changes, **{"safety.stall": 0.2}).control.period == 0.1


def test_a_delay_is_within_the_history() -> None:
    config = axes(1, width_limit=1.0).replace(**{"safety.off": ["late"]})
    longest = config.control.history
    config.replace(**{"measurement.delays": [0.0, longest]})
    with pytest.raises(
        ConfigError, match=r"measurement\.delays\[1\]: got .*at most control\.history"
    ):
        config.replace(**{"measurement.delays": [0.0, 1.01 * longest]})


def test_a_delay_is_at_most_the_age_of_what_is_used() -> None:
    config = axes(1, width_limit=1.0)
    oldest = config.safety.frame_age
    config.replace(**{"measurement.delays": [oldest]})
    with pytest.raises(ConfigError, match=r"delays\[0\]: got 0\.4.*at most safety\.frame_age"):
        config.replace(**{"measurement.delays": [0.4]})


def test_what_is_older_than_the_history_is_late() -> None:
    with pytest.raises(ConfigError, match=r"safety\.frame_age: got 0\.3, expected at most control"):
        Config().replace(**{"control.history": 0.25})
    assert Config().replace(**{"control.history": 0.25, "safety.frame_age": 0.25})


def test_an_empty_document_is_the_default() -> None:
    assert from_document({}) == Config()


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Config(profile="nope"), "profile"),
        (lambda: Config(insertion=3), "insertion"),
        (lambda: Config(drives={"node": 1}), "drives.node"),
        (lambda: TwinConfig(image_noise=math.inf), "image_noise"),
        (lambda: TwinConfig(latency=0.0), "latency_jitter"),
        (lambda: VisionConfig(weights=(1.0, 2.0)), "weights"),
        (lambda: VisionConfig(weights=(1.0, 2.0, "a")), "weights[2]"),
        (lambda: InstrumentConfig(marker_a=14e-3), "marker_a"),
        (lambda: ControlConfig(period=1e-4), "history"),
        (
            lambda: DofConfig(
                expected_width=8e-3,
                update_distance=1.0,
                observable_deviation=1.0,
                start_deviation=1.0,
                free_gain=6.0,
            ),
            "free_gain",
        ),
        (
            lambda: Config(
                experiment=ExperimentConfig(bending=Sine(centre=0.9, amplitude=0.9, period=2.0))
            ),
            "experiment.bending.period",
        ),
    ],
)
def test_a_constructor_checks_as_a_file_does(make: Callable[[], object], field: str) -> None:
    with pytest.raises(ConfigError) as error:
        make()
    assert error.value.field == field
    assert error.value.allowed


def test_numpy_numbers_become_pythons() -> None:
    vision = VisionConfig(weights=np.array([1, 2, 3]), smoothing=np.int64(2))  # type: ignore[arg-type]
    assert vision == VisionConfig(weights=(1.0, 2.0, 3.0), smoothing=2)
    assert [type(weight) for weight in vision.weights] == [float, float, float]
    changes = {"twin.seed": np.uint8(7), "camera.distortion": np.zeros(8), "insertion.free_gain": 3}
    config = Config().replace(**changes)
    assert config == Config().replace(
        **{"twin.seed": 7, "camera.distortion": (0.0,) * 8, "insertion.free_gain": 3.0}
    )
    with pytest.raises(ConfigError, match=r"insertion\.free_gain"):
        Config().replace(**{"insertion.free_gain": np.float64(0.5)})


def test_shipped_configurations_have_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert load_config("bench") == load_config(CONFIGS / "bench.toml")
    monkeypatch.chdir(tmp_path)
    Path("bench").write_text("profile = 'paper'")
    assert load_config("bench").profile == "paper"


def test_sections_of_older_documents_are_ignored_with_one_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = (
        'profile = "plays"\n[adaptive]\ntip_gain = 1.5\n[state_estimation]\ntip_deviation = 0.1\n'
    )
    assert loaded(tmp_path, text) == Config()
    (record,) = (each for each in caplog.records if each.levelname == "WARNING")
    assert "[adaptive], [state_estimation]" in record.getMessage()
    with pytest.raises(ConfigError, match="adaptive"):
        Config().replace(**{"adaptive.tip_gain": 1.5})
