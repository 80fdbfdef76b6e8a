"""Disturbances by name, on the command line and in a configuration."""

from pathlib import Path

import pytest
from tautscope.cli import main
from tautscope.config import DISTURBANCES, Config, dump_config, load_config
from tautscope.errors import ConfigError
from tautscope.report import demo


def test_an_unknown_name_is_rejected_with_the_known_names(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(ConfigError) as error:
        Config().replace(**{"twin.disturb": ("smoke", "smog")})
    assert error.value.field == "twin.disturb[1]"
    assert all(name in error.value.allowed for name in DISTURBANCES)
    assert main(["demo", "--disturb", "smoke,smog"]) == 2
    message = capsys.readouterr().err
    assert "'smog'" in message and "white_balance" in message


def test_the_command_line_takes_several_names_and_a_background(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    seen: list[Config] = []

    def stop(config: Config, *_: object) -> None:
        seen.append(config)
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "run_demo", stop)
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "--background", str(tmp_path), "--disturb", "smoke, debris"]) == 130
    assert seen[0].twin.disturb == ("smoke", "debris")
    assert seen[0].twin.background == str(tmp_path)


def test_a_configuration_with_disturbances_is_read_back(tmp_path: Path) -> None:
    config = Config().replace(**{"twin.disturb": ["smoke", "debris"]})
    assert config.twin.disturb == ("smoke", "debris")
    file = tmp_path / "c.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    assert load_config(file) == config
