"""The files of the page, and the headers that confine it."""

from importlib.resources import files

from websockets.datastructures import Headers
from websockets.http11 import Response

_TYPES = {
    "css": "text/css; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}


class Pages:
    """All files of the page in memory: path -> content type and content. There are no others."""

    def __init__(self, hosts: list[str]) -> None:
        self.files = {
            f"/{file.name}": (_TYPES[kind], file.read_bytes())
            for file in (files("tautscope.console") / "page").iterdir()
            if (kind := file.name.rpartition(".")[2]) in _TYPES
        }
        self.files["/"] = self.files["/index.html"]
        sockets = " ".join(f"ws://{host}" for host in hosts)
        self._policy = (
            f"default-src 'none'; script-src 'self'; style-src 'self'; connect-src {sockets}; "
            "img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )

    def response(self, target: str) -> Response:
        """The answer to a request for a path with an optional query."""
        found = self.files.get(target.partition("?")[0])
        if found is None:
            return self.plain(404, "Not Found")
        return self._response(200, "OK", *found)

    def plain(self, status: int, reason: str) -> Response:
        """An answer without a page."""
        return self._response(status, reason, "text/plain; charset=utf-8", reason.encode())

    def _response(self, status: int, reason: str, kind: str, body: bytes) -> Response:
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Connection": "close",
            "Cache-Control": "no-store",
            "Content-Security-Policy": self._policy,
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
        }
        return Response(status, reason, Headers(headers), body)
