"""The command ``tautscope config``."""

import argparse

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.config import load_config, to_document
from tautscope.config.placeholders import placeholders
from tautscope.config.template import template


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    config = arguments.add_verb(
        verbs,
        "config",
        _config,
        help="print the configuration",
        description="Print the configuration as TOML: every key with its meaning, unit and range.",
    )
    arguments.add_config(config)
    arguments.add_json(config)


def _config(options: argparse.Namespace) -> None:
    config = load_config(options.config)
    print_json(options, to_document(config))
    print(template(config, placeholders(options.config)), end="")
