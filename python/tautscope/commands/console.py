"""The command ``tautscope console``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from tautscope.commands import arguments
from tautscope.commands.article_config import article_config
from tautscope.commands.printing import print_json
from tautscope.config import Config, load_config
from tautscope.config.placeholders import refuse_placeholders
from tautscope.errors import ConfigError, FieldError
from tautscope.extras import require_extras
from tautscope.loop.rig import Rig


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    console = arguments.add_verb(
        verbs,
        "console",
        help="see, steer and stop the instrument in a browser",
        description="Serve the operator's console on 127.0.0.1 and print its address with a new "
        "token. Without --twin or --replay THE MOTORS of the configuration, or of --rig, MOVE, "
        "once an operator enables them on the page. Research software, not a medical device; a "
        "stop on the page is no emergency stop: have one in hardware, within reach.",
        extras=["console"],
    )
    arguments.add_config(console)
    arguments.add_profile(console, "how slack is compensated")
    kind = console.add_mutually_exclusive_group()
    kind.add_argument("--twin", action="store_true", help="steer the simulated instrument")
    kind.add_argument("--rig", metavar="MODULE:CLASS", help="steer a rig of yours: docs/robots.md")
    kind.add_argument("--replay", type=Path, metavar="LOG", help="show a log; nothing is steered")
    console.add_argument(
        "--robot",
        choices=["colonoscope"],
        help="with --twin, another simulated robot in place of the article's instrument",
    )
    console.add_argument(
        "--port", type=arguments.natural, default=0, metavar="N", help="port [a free one]"
    )
    arguments.add_out(console, "console")
    arguments.add_json(console)
    console.set_defaults(run=_console)


def _console(options: argparse.Namespace) -> int:
    if not 0 <= options.port <= 65535:
        raise ConfigError("port", options.port, "a port from 0 to 65535")
    if options.replay is not None:
        require_extras("tautscope console --replay", ["hardware"])
        from tautscope.console.log_player import play  # noqa: PLC0415

        return play(
            options.replay,
            options.port,
            lambda url: _announce(options.json, url, str(options.replay), "Nothing moves."),
        )
    if options.robot is not None and not options.twin:
        raise FieldError("--robot", options.robot, "--twin beside it")
    require_extras("tautscope console", ["twin" if options.twin else "hardware"])
    from tautscope.console.start import make_rig, start_console  # noqa: PLC0415
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415

    config, make = _config_and_maker(options)
    folder = check_free(options.out or default_folder("console"))
    what = "the twin" if options.twin else f"REAL MOTORS of {options.rig or options.config}"
    rig, config = make_rig(config, is_twin=options.twin, make=make)
    return start_console(
        rig,
        config,
        folder,
        options.port,
        lambda url: _announce(options.json, url, what, "Whoever has this address can move it."),
    )


def _config_and_maker(options: argparse.Namespace) -> tuple[Config, Callable[[Config], Rig] | None]:
    """The configuration, and what makes the rig if it is not of the article."""
    if options.robot is not None:
        from tautscope.twin.colonoscope import ColonoscopeTwin  # noqa: PLC0415

        config = load_config(options.config or options.robot, options.profile)
        return config, lambda _: ColonoscopeTwin()
    if options.rig is not None:
        from tautscope.runs.rigs import rig_maker  # noqa: PLC0415

        return load_config(options.config, options.profile), rig_maker(options.rig)
    config = article_config(options.config, options.profile)
    if not options.twin:
        refuse_placeholders(options.config)
        if config.drives is None:
            raise ConfigError("drives", None, "a section [drives], or the option --twin or --rig")
    return config, None


def _announce(is_json: bool, url: str, what: str, note: str) -> None:
    if is_json:
        print_json({"url": url})
    else:
        print(f"The console of {what}: {url}\n{note} Ctrl-C ends.")
    sys.stdout.flush()
