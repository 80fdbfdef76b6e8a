"""The documentation site: every page is listed, notebooks hold no outputs, links are checked."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from common.paths import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
INDEX = ROOT / "docs" / "site" / "index.md"


def check_links(site: Path) -> list[str]:
    """The lines that the check of a built site prints."""
    program = [sys.executable, ROOT / "docs" / "site" / "check_links.py", site]
    found = subprocess.run(program, capture_output=True, text=True, check=False)
    assert found.returncode == bool(found.stdout), found.stderr
    return found.stdout.splitlines()


def test_every_page_is_in_the_list_of_pages() -> None:
    listed = re.findall(r"<([\w./-]+)>", INDEX.read_text(encoding="utf-8"))
    paths = {(INDEX.parent / name).resolve() for name in listed}
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *NOTEBOOKS]
    pages += (ROOT / "docs" / "interfaces").glob("*.md")
    pages += (ROOT / "rigs").rglob("*.md")
    pages += [page for page in INDEX.parent.glob("*.md") if page != INDEX]
    assert {page.with_suffix("") for page in pages} == paths


def test_the_paper_cites_what_its_bibliography_has() -> None:
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text("utf-8"), re.M)
    assert set(re.findall(r"@(\w+)", text)) == set(entries)
    body = re.sub(r"<!--.*?-->", "", text.split("---", 2)[2], flags=re.DOTALL)
    assert 750 <= len(body.split()) <= 1750, "the length that the journal asks for"


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_stored_without_outputs(notebook: Path) -> None:
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


def test_a_sound_site_has_no_problem(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<h1 id="top">A</h1><a href="sub/b.html#here">b</a><a href="#top">top</a>'
        '<a href="https://example.org/">elsewhere</a><img src="data:image/png;base64,AA==">'
        '<link rel="stylesheet" href="a.css">'
    )
    (tmp_path / "a.css").write_text("body { background: url(data:image/png;base64,AA==) }")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "b.html").write_text('<p id="here"><a href="../a.html?x=1">a</a></p>')
    assert check_links(tmp_path) == []


@pytest.mark.parametrize(
    ("html", "problem"),
    [
        ('<a href="b.html">', "a.html: no file b.html"),
        ('<a href="#there">', "a.html: no anchor #there"),
        ('<a href="a.html#there">', "a.html: no anchor a.html#there"),
        ('<img src="b.png">', "a.html: no file b.png"),
        (
            '<script src="https://example.org/x.js"></script>',
            "a.html: loads https://example.org/x.js",
        ),
        (
            '<link rel="stylesheet" href="//example.org/x.css">',
            "a.html: loads //example.org/x.css",
        ),
    ],
)
def test_a_broken_link_or_a_page_that_loads_from_elsewhere_is_named(
    tmp_path: Path, html: str, problem: str
) -> None:
    (tmp_path / "a.html").write_text(html)
    assert check_links(tmp_path) == [problem]


def test_a_style_sheet_that_loads_from_elsewhere_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.css").write_text('@import "https://example.org/font.css";')
    assert check_links(tmp_path) == ["a.css: loads from elsewhere"]
