"""Check a built site: every link leads somewhere in it, and no page loads anything from elsewhere.

``python docs/site/check_links.py target/site``; exit status 1 and a line per problem otherwise.
"""

import re
import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = re.compile(r"""(?:url\(|@import)\s*["']?(?:https?:)?//""")
"""A style sheet that loads from elsewhere."""


class Page(HTMLParser):
    """Anchors, links and loaded resources of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what a tag names or loads."""
        values = {name: value for name, value in attrs if value}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        elif "src" in values:
            self.loaded.append(values["src"])
        elif tag == "link" and values.get("rel") not in ("canonical", "author"):
            self.loaded.append(values.get("href", ""))


def problems(site: Path) -> Iterator[str]:
    """A line for each broken link, and for each resource from elsewhere."""
    parsed = cache(Page)
    # The pages of cargo doc, which checks its own links, are only led to.
    own = [path for path in sorted(site.rglob("*.html")) if site / "rust" not in path.parents]
    for path in own:
        name, page = path.relative_to(site), parsed(path)
        for target in [*page.links, *page.loaded]:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                if target in page.loaded and parts.scheme != "data":
                    yield f"{name}: loads {target}"
                continue
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not file.is_file():
                yield f"{name}: no file {target}"
            elif file in own and unquote(parts.fragment) not in {"", *parsed(file).anchors}:
                yield f"{name}: no anchor {target}"
    for path in site.rglob("*.css"):
        if site / "rust" not in path.parents and LOADED.search(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(site)}: loads from elsewhere"


if __name__ == "__main__":
    found = list(problems(Path(sys.argv[1]).resolve()))
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))
