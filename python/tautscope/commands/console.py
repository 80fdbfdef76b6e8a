"""The command ``tautscope console``."""

import argparse
from pathlib import Path

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.commands.rig_choice import add_rig, add_robot, choose_rig, rig_in_words
from tautscope.errors import ConfigError
from tautscope.extras import require_extras


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    console = arguments.add_verb(
        verbs,
        "console",
        _console,
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
    add_rig(kind, "steer a rig of yours")
    kind.add_argument("--replay", type=Path, metavar="LOG", help="show a log; nothing is steered")
    add_robot(console, "with --twin, another simulated robot in place of the article's instrument")
    console.add_argument(
        "--port", type=arguments.natural, default=0, metavar="N", help="port [a free one]"
    )
    arguments.add_out(console, "console")
    arguments.add_json(console)


def _console(options: argparse.Namespace) -> int:
    if not 0 <= options.port <= 65535:
        raise ConfigError("port", options.port, "a port from 0 to 65535")

    def announce(url: str) -> None:
        print_json(options, {"url": url})
        print(f"The console of {what}: {url}\n{note} Ctrl-C ends.", flush=True)

    if options.replay is not None:
        shown = "no --replay, which only shows a log"
        arguments.refuse_unused(options, shown, "config", "profile", "robot", "out")
        require_extras("tautscope console --replay", ["hardware"])
        from tautscope.console.log_player import play  # noqa: PLC0415

        what, note = str(options.replay), "Nothing moves."
        return play(options.replay, options.port, announce)
    require_extras("tautscope console", ["twin" if options.twin else "hardware"])
    from tautscope.console.actions import replay_command  # noqa: PLC0415
    from tautscope.console.start import start_console  # noqa: PLC0415

    config, make = choose_rig(options, in_real_time=True)
    folder = arguments.out_folder(options)
    what, note = rig_in_words(options), "Whoever has this address can move it."
    status = start_console(make(config), config, folder, options.port, announce)
    for log in sorted(folder.glob("console-*.mcap")):
        print_json(options, {"log": str(log)})
        print(f"Log: {log}\nSee it again: {replay_command(log)}", flush=True)
    return status
