"""Descriptions of all configuration keys, from the docstrings and types of the sections.

The commented template (`tautscope config`) and the reference page (docs/configuration.md) both
come from here.
"""

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import msgspec
import msgspec.inspect as types

from tautscope.config.ranges import allowed_values
from tautscope.config.root import Config
from tautscope.config.section import Section, default_of

_UNIT = re.compile(
    r"\[((?:in )?(?:m|rad|s|half|px|N|bit|grey|share|shares|1|standard|update_distance|width_limit|"
    r"ahead_limit|control)\b[^\]]*)\]"
)


@dataclass(frozen=True)
class Key:
    """One key of a section; `section` is its type if it is a section, or a list of them."""

    name: str
    text: str
    unit: str
    allowed: str
    default: Any
    is_required: bool
    section: type[Section] | None
    is_list: bool = False


def package_text() -> str:
    """Units of a configuration, and what brackets mean: the end of the package's docstring."""
    text = _plain(inspect.cleandoc(sys.modules["tautscope.config"].__doc__ or ""))
    return text.partition("\n\n")[2]


@cache
def section_text(section: type[Section]) -> str:
    """The docstring of a section, without indentation and markup."""
    return _plain(inspect.cleandoc(section.__doc__ or ""))


def keys(section: type[Section]) -> Iterator[Key]:
    """The keys of a section in the order of their definition, sections last."""
    texts = _docstrings(section.__module__)[section.__name__]
    found = []
    for field in msgspec.structs.fields(section):
        kind, default = types.type_info(field.type), default_of(field)
        text = texts.get(field.name, "")
        unit = _UNIT.search(text)
        is_required = default is msgspec.NODEFAULT
        found.append(
            Key(
                field.name,
                _plain(text),
                "" if unit is None else _plain(unit[1]),
                allowed_values(kind),
                None if is_required else default,
                is_required,
                _section(kind),
                isinstance(kind, types.VarTupleType),
            )
        )
    yield from sorted(found, key=lambda key: key.section is not None)


def all_sections(
    section: type[Section] = Config, path: str = ""
) -> Iterator[tuple[str, type[Section]]]:
    """Dotted path and type of every section, a section before those in it."""
    yield path, section
    for key in keys(section):
        if key.section is not None:
            place = f"{path}.{key.name}".lstrip(".")
            yield from all_sections(key.section, f"[{place}]" if key.is_list else place)


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """Class -> field -> text after the field, in a module."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    texts: dict[str, dict[str, str]] = {}
    for section in (node for node in tree.body if isinstance(node, ast.ClassDef)):
        of_section = texts[section.name] = {}
        for field, below in pairwise(section.body):
            match field, below:
                case ast.AnnAssign(ast.Name(name)), ast.Expr(ast.Constant(str(text))):
                    of_section[name] = textwrap.dedent(text)
    return texts


def _plain(text: str) -> str:
    """One line per paragraph, without backquotes."""
    paragraphs = re.split(r"\n\s*\n", text.replace("`", "").strip())
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def _section(kind: types.Type) -> Any:
    match kind:
        case types.StructType(cls=section):
            return section
        case types.VarTupleType(item_type=item):
            return _section(item)
        case types.UnionType(types=members):
            return next(filter(None, map(_section, members)), None)
    return None
