"""Sphinx configuration of the documentation site; ``.ci/docs`` builds it into target/site.

The source folder is the repository, so that its pages are used where they are and as they are.
"""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import cast

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]

project = "tautscope"
author = copyright = "The tautscope authors"
version = release = PACKAGE["version"]
root_doc = "docs/site/index"
include_patterns = ["*.md", "rigs/*/*.md", "docs/*.md", "docs/*/*.md", "docs/notebooks/*.ipynb"]
exclude_patterns = [".*", "target", "crates", "python", "tests", "benchmarks", "fuzz", "paper"]
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinxarg.ext"]

myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_numpy_docstring = napoleon_attr_annotations = napoleon_use_rtype = False

default_role = "code"  # docstrings mark names with single backticks, as Markdown does

html_theme = "furo"
html_title = f"tautscope {release}"
html_extra_path = ["front"]
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False

LINK = re.compile(r"(?<=\]\()(?!https?:)([^)#\s]+)")
FOLDERS = {"docs/decisions": "/docs/site/decisions.md"}
"""Folders with a page of their own."""
PAGES = (".md", ".ipynb", ".png", ".jpg", ".gif")
TYPES = {
    r"[~\w.]*_Buffer \|.*?_NestedSequence\[complex \| bytes \| str\]": "ArrayLike",
    r"[~\w.]*ndarray\[[~\w.]*tuple\[[~\w.]*Any, \.\.\.\], [~\w.]*dtype\[[~\w.]*?(\w+)\]\]": (
        r"NDArray[\1]"
    ),
    r"\b_Floats\b": "NDArray[float64]",
    r"\b_Triggers\b": "tuple[str | None, str | None]",
}
"""Types that are not printed as they are written: pattern and text."""


def resolve_links(app: Sphinx, name: str, source: list[str]) -> None:
    """Turn links to files that are no pages of the site into links to the repository."""
    page = ROOT / app.env.doc2path(name, base=False)

    def resolved(match: re.Match[str]) -> str:
        target = (page.parent / match[1]).resolve()
        if not target.exists() or not target.is_relative_to(ROOT):
            return match[1]  # Sphinx reports it
        path = PurePosixPath(target.relative_to(ROOT).as_posix())
        if str(path) in FOLDERS:
            return FOLDERS[str(path)]
        if path.suffix in PAGES and path.parts[0] not in exclude_patterns:
            return match[1]
        kind = "tree" if target.is_dir() else "blob"
        return f"{PACKAGE['repository']}/{kind}/main/{path}"

    source[0] = LINK.sub(resolved, source[0])


def escape_bars(*about: object) -> None:
    """Keep the bars of absolute values in docstrings: reStructuredText substitutes between them."""
    lines = cast("list[str]", about[-1])
    lines[:] = [line.replace("|", r"\|") for line in lines]


def stub_signatures() -> Iterator[tuple[str, tuple[str, str | None]]]:
    """Name, signature and returned type of every function in the stub of the compiled module."""
    stub = ROOT / "python" / "tautscope" / "_core.pyi"
    for kind in ast.parse(stub.read_text(encoding="utf-8")).body:
        for function in kind.body if isinstance(kind, ast.ClassDef) else ():
            if isinstance(function, ast.FunctionDef) and not function.decorator_list:
                del function.args.args[0]
                text = f"({ast.unparse(function.args)})"
                if function.name == "__new__":
                    yield f"tautscope.{kind.name}", (text, None)
                else:
                    returned = ast.unparse(function.returns) if function.returns else None
                    yield f"tautscope.{kind.name}.{function.name}", (text, returned)


STUBS = dict(stub_signatures())


def write_types(
    app: Sphinx, kind: str, name: str, thing: object, options: object, *texts: str | None
) -> tuple[str | None, ...]:
    """Signature and returned type with the types as the source has them."""

    def written(text: str | None) -> str | None:
        for pattern, replacement in TYPES.items():
            text = text and re.sub(pattern, replacement, text)
        return text

    return tuple(map(written, STUBS.get(name, texts)))


def setup(app: Sphinx) -> None:
    """Connect the handlers."""
    app.connect("source-read", resolve_links)
    app.connect("autodoc-process-docstring", escape_bars)
    app.connect("autodoc-process-signature", write_types)
