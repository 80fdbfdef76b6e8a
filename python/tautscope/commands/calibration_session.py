"""A calibration of all kinds in sequence: its state, which survives an interruption, and report."""

import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import msgspec

from tautscope.calibration.result import CalibrationResult
from tautscope.commands.arguments import article_config
from tautscope.config import Config
from tautscope.config.edit import writable_file, write_values
from tautscope.errors import ConfigError
from tautscope.report.report import configuration, document, embedded
from tautscope.runs.output_folder import replace_text


class SessionState(msgspec.Struct, forbid_unknown_fields=True):
    """The state file beside the configuration.

    Attributes:
        drawn: Values of the twin, drawn about the configuration before the first step.
        done: Names of the steps done or skipped.
    """

    folder: str
    seed: int | None = None
    drawn: dict[str, Any] | None = None
    done: list[str] = msgspec.field(default_factory=list)
    is_finished: bool = False


class CalibrationSession:
    """A sequence of calibrations of one configuration file, begun or resumed.

    Args:
        file: The configuration.
        folder: Folder of the report of a new session.
        seed: Seed of the twin, None on a rig.
        restart: Whether an unfinished session is dropped.

    Attributes:
        state: What is done.

    Raises:
        MissingPathError, ConfigError: The file is missing or shipped, its state is damaged, or the
            session to be resumed is of another rig.
    """

    def __init__(self, file: Path, folder: Path, seed: int | None, *, restart: bool) -> None:
        self._file = file
        self._state_file = writable_file(file).with_suffix(".calibration.json")
        state = None if restart else _read(self._state_file)
        if state is None or state.is_finished:
            drawn = None
            if seed is not None:
                from tautscope.twin.drawn_rig import draw_values  # noqa: PLC0415  MuJoCo

                drawn = draw_values(self.config, seed)
            state = SessionState(str(folder.absolute()), seed, drawn)
        if state.seed != seed:
            names = [
                "the rig" if one is None else f"--twin --seed {one}" for one in (state.seed, seed)
            ]
            allowed = f"{names[0]}, whose calibration is unfinished; or --restart"
            raise ConfigError("session", names[1], allowed)
        self.state, self.folder = state, Path(state.folder)

    @property
    def config(self) -> Config:
        """The configuration as it is now."""
        return article_config(self._file)

    def finish_step(self, name: str, result: CalibrationResult | None) -> None:
        """Write values, figures and notes of a step, None if it was skipped; note it as done."""
        if result is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            files = []
            for k, (figure, caption) in enumerate(result.figures):
                file = f"{name}_{k + 1}.png"
                figure.savefig(self.folder / file, dpi=130)
                files.append([file, caption])
            values = result.rounded_values()
            document = {"values": values, "notes": list(result.notes), "figures": files}
            _write(self.folder / f"{name}.json", document | {"std": dict(result.std)})
            if values:
                write_values(self._file, result.changes())
        self.state.done.append(name)
        _write(self._state_file, msgspec.to_builtins(self.state))

    def finish(self, titles: Mapping[str, str]) -> Path:
        """Write the report, and note that all is done; the path of the report."""
        self.folder.mkdir(parents=True, exist_ok=True)
        report = self.folder / "report.html"
        report.write_text(self._page(titles), encoding="utf-8")
        self.state.is_finished = True
        _write(self._state_file, msgspec.to_builtins(self.state))
        return report

    def _page(self, titles: Mapping[str, str]) -> str:
        parts = []
        for name, title in titles.items():
            file = self.folder / f"{name}.json"
            parts.append(f"<h2>{escape(title)}</h2>")
            if not file.exists():
                parts.append('<p class="note">Skipped.</p>')
                continue
            found = json.loads(file.read_text(encoding="utf-8"))
            parts += [f"<p>{escape(note)}</p>" for note in found["notes"]]
            if found["values"]:
                parts.append(_table(found["values"], found["std"]))
            for file, caption in found["figures"]:
                parts.append(embedded((self.folder / file).read_bytes(), "png", caption))
        parts.append(configuration(self.config))
        kind = "a simulated rig" if self.state.seed is not None else "the rig"
        return document("Calibration", f"Calibration of {kind} of {self._file}.", "\n".join(parts))


def _table(values: Mapping[str, Any], std: Mapping[str, float]) -> str:
    rows = []
    for key, value in values.items():
        items = value if isinstance(value, list) else [value]
        shown = ", ".join(f"{item:g}" if isinstance(item, float) else str(item) for item in items)
        known = [std[name] for name in (key, *(f"{key}[{k}]" for k in range(8))) if name in std]
        spread = ", ".join(f"{each:.2g}" for each in known)
        rows.append(f"<tr><td>{escape(key)}</td><td>{shown}</td><td>{spread}</td></tr>")
    head = "<tr><th>key</th><th>value</th><th>standard deviation</th></tr>"
    table = f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"
    return f'<div class="wide">{table}</div>'


def _read(path: Path) -> SessionState | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=SessionState)
    except FileNotFoundError:
        return None
    except msgspec.MsgspecError as error:
        allowed = f"a state of `tautscope calibrate all` ({error}); or --restart"
        raise ConfigError("session", str(path), allowed) from None


def _write(path: Path, document: object) -> None:
    """Replace a file in one step."""
    replace_text(path, json.dumps(document, indent=1))
