"""The messages at the start of a log: configuration, run, versions and camera."""

import json
import platform
import tomllib
from collections.abc import Iterable, Mapping

import tomlkit

from tautscope._core import __version__
from tautscope.config import Config, dump_config, from_document
from tautscope.errors import ConfigError, RecordError
from tautscope.extras import installed_version
from tautscope.log import topics
from tautscope.log.fields import camera_info
from tautscope.loop.references import Segment
from tautscope.runs.recording import read_run_facts, run_facts


def header_messages(
    config: Config, compensated: bool, segments: Iterable[Segment], stamp: int
) -> dict[str, bytes]:
    """The messages at the start of a log: configuration, run, versions, and a camera if used."""
    messages = {
        topics.CONFIG: {"data": dump_config(config)},
        topics.RUN: {"data": tomlkit.dumps(run_facts(compensated, segments))},
        topics.VERSIONS: {"data": json.dumps(software_versions())},
    }
    if not config.dof:
        messages[topics.CAMERA_INFO] = camera_info(stamp, config.camera)
    return topics.encode_all(messages)


def software_versions() -> dict[str, str]:
    """Versions of tautscope, Python and the libraries of a log; the kind of machine."""
    return {
        "tautscope": __version__,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{name: installed_version(name) for name in ("numpy", "opencv-python-headless", "mcap")},
    }


def read_header(
    messages: Mapping[str, bytes],
) -> tuple[Config, bool, tuple[Segment, ...], dict[str, str]]:
    """Read configuration, compensation, segments and versions of `header_messages`.

    Raises:
        RecordError: A message is missing or invalid.
        ConfigError: The configuration has a key that this version does not know.
    """
    needed = (topics.CONFIG, topics.RUN, topics.VERSIONS)
    allowed = f"a log of tautscope, with {topics.CONFIG}, {topics.RUN} and {topics.VERSIONS}"
    if not messages.keys() >= set(needed):
        found = ", ".join(messages) or "no messages at the start"
        raise RecordError("log", found, allowed)
    try:
        texts = {topic: topics.decode(topic, messages[topic]).data for topic in needed}
        config = from_document(tomllib.loads(texts[topics.CONFIG]))
        facts = read_run_facts(texts[topics.RUN], config)
        return config, *facts, json.loads(texts[topics.VERSIONS])
    except ConfigError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise RecordError("log", f"{type(error).__name__}: {error}", allowed) from None
