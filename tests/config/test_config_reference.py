"""Template and reference page of the configuration."""

import re
import tomllib
from pathlib import Path

import configuration
import msgspec
import pytest
from tautscope.config import RIGS, Config, config_file, load_config
from tautscope.config.descriptions import all_sections, keys
from tautscope.config.placeholders import placeholders, refuse_placeholders
from tautscope.config.template import template
from tautscope.errors import ConfigError

CONFIGS = [None, *RIGS]


@pytest.mark.parametrize("name", CONFIGS)
def test_the_template_reads_back_equal(name: str | None, tmp_path: Path) -> None:
    config = load_config(name)
    file = tmp_path / "template.toml"
    file.write_text(template(config, placeholders(name)), encoding="utf-8")
    assert load_config(file) == config
    assert set(placeholders(file)) == set(placeholders(name))


MARKED = """\
profile = "best" # REPLACE
recording = { flush_period = 0.1 } # REPLACE
control.period = 0.01 # REPLACE: of the drives
[drives] # REPLACE
interface = "socketcan"
[drives.motors.turn] # REPLACE
node = 1
counts_per_unit = 1e4
speed_limit = 1.0
travel = [ # REPLACE
  -1.0,
  1.0,
]
[camera] # REPLACE
fx = 424.0
[drives.motors.reach]
node = 2 # REPLACE
counts_per_unit = 1e4
speed_limit = 1.0
travel = [
  -1.0,
  1.0, # REPLACE
]
[actuators]
matrix = [[1.0, 0.0], [0.0, 1.0]] # REPLACE
names = ["turn", "reach"]
units = ["rad", "rad"]
# REPLACE is no placeholder in a line of its own.
[[dof]]
name = "a"
width_limit = 0.2 # REPLACE
[[dof]] # REPLACE
name = "b"
width_limit = 0.2
"""
PLACES = """profile; recording; control.period; drives; drives.motors.turn;
drives.motors.turn.travel; camera; drives.motors.reach.node; drives.motors.reach.travel;
actuators.matrix; dof[0].width_limit; dof[1]"""


def test_placeholders_are_found_everywhere_and_kept_in_the_template(tmp_path: Path) -> None:
    mine, copy = tmp_path / "mine.toml", tmp_path / "copy.toml"
    mine.write_text(MARKED, encoding="utf-8")
    assert placeholders(mine) == tuple(re.split(r";\s", PLACES))
    config = load_config(mine)
    copy.write_text(template(config, placeholders(mine)), encoding="utf-8")
    assert load_config(copy) == config
    assert list(load_config(copy).drives.motors) == ["turn", "reach"]  # type: ignore[union-attr]
    assert set(placeholders(copy)) == set(placeholders(mine))


def test_every_key_of_the_template_has_its_meaning_and_range() -> None:
    text = template(Config())
    flat = re.sub(r"\n(# )+", " ", text)
    for path, section in all_sections():
        for key in keys(section):
            if key.section is None:
                assert len(key.text) > 5, f"{path}.{key.name}"
                assert f"{key.text} Allowed: {key.allowed}." in flat, f"{path}.{key.name}"
    assert all(len(line) <= 140 for line in text.splitlines())


def test_uncommented_drives_need_only_what_is_required() -> None:
    lines = template(Config()).splitlines()
    start = lines.index("# [drives]")
    end = lines.index("# [[dof]]")
    text = "\n".join(line.removeprefix("# ") for line in lines[start:end])
    values = {"node": "", "travel": "[0, 2]", "counts_per_unit": "1e4"}
    nodes = iter(range(1, 4))
    text = re.sub(
        r"^(\w+) = \.\.\.  # required$",
        lambda match: f"{match[1]} = {values.get(match[1], '1') or next(nodes)}",
        text,
        flags=re.MULTILINE,
    )
    drives = tomllib.loads(re.sub(r"^(eds|model|stops|preset) =$", "", text, flags=re.MULTILINE))
    config = msgspec.convert(drives["drives"], type(load_config("bench").drives))
    assert (
        config.cycle
        == type(config)(
            insertion=config.insertion, rotation=config.rotation, bending=config.bending
        ).cycle
    )


def test_the_page_is_up_to_date() -> None:
    assert configuration.PAGE.read_text(encoding="utf-8") == configuration.page(), (
        "run `uv run docs/configuration.py`"
    )


def test_short_ranges_have_every_bound_and_choice() -> None:
    short = configuration.short_range
    assert short("a number above 0 and below 1") == "> 0 and < 1"
    assert short("a whole number of at least 3") == "whole, >= 3"
    assert short("2 values, each a number from -1 to 1") == "2 x -1 to 1"
    for _, section in all_sections():
        for key in keys(section):
            bounds = re.findall(r'-?\d[\d.,]*\d|\d|"[^"]*"', key.allowed)
            assert re.findall(r'-?\d[\d.,]*\d|\d|"[^"]*"', short(key.allowed)) == bounds, key.name


def test_a_repeated_section_has_the_defaults_that_differ() -> None:
    (text,) = re.findall(r"## `\[rotation\]`\n\n(.*)", configuration.page())
    both = Config().insertion, Config().rotation
    for name in msgspec.structs.asdict(both[0]):
        first, second = (getattr(each, name) for each in both)
        assert (f"`{name}` `{second}`" in text) == (first != second), name


def test_placeholders_are_refused_by_name() -> None:
    with pytest.raises(ConfigError) as found:
        refuse_placeholders("article_rig")
    text = config_file("article_rig").read_text(encoding="utf-8")
    assert len(found.value.field.split(", ")) == sum(
        "REPLACE" in line and not line.startswith("#") for line in text.splitlines()
    )
    assert "drives.insertion.counts_per_unit" in found.value.field
    refuse_placeholders("bench")
