"""The server of the page: on this machine only, for who has the address with its token, and for this page only.

Every request must name this host (a foreign name that leads here is refused: DNS rebinding), have the token in its
path, and come from the page itself or from the address line. The page loads nothing from elsewhere; its policy forbids
it to.
"""

import json
import secrets
import urllib.parse
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any

from aatri.errors import AatriError, InputError
from aatri.measuring.measured_table import ChangedMeanwhile
from aatri.measuring.session import Session, Values

HOST = "127.0.0.1"
PAGE = {
    "": ("index.html", "text/html; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
LARGEST_BODY = 100_000
TILE_SECONDS = 600
"""For so long a browser keeps a tile."""


class MeasuringServer(ThreadingHTTPServer):
    """Serves one block folder on 127.0.0.1."""

    daemon_threads = True

    def __init__(self, session: Session, port: int = 0) -> None:
        super().__init__((HOST, port), _Requests)
        self.session = session
        self.token = secrets.token_urlsafe(24)

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Drop what a browser that goes away leaves: an unfinished request."""


class _Requests(BaseHTTPRequestHandler):
    """Requests of the page."""

    protocol_version = "HTTP/1.1"
    server: MeasuringServer

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing of requests."""

    def do_GET(self) -> None:
        """Parts of the page, tiles, and what is measured."""
        self._answered(self._get)

    def do_POST(self) -> None:
        """Changes."""
        self._answered(self._post)

    def _answered(self, answer: Any) -> None:
        """Answer, or say in one sentence why not."""
        try:
            path = self._allowed()
            if path is None:
                self._send(
                    {"error": "not for you: open the address that `aatri measure` has printed"}, HTTPStatus.FORBIDDEN
                )
            else:
                answer(*path)
        except ChangedMeanwhile as error:
            self._send({"error": _sentence(error)}, HTTPStatus.CONFLICT)
        except AatriError as error:
            self._send({"error": _sentence(error)}, HTTPStatus.BAD_REQUEST)
        except (KeyError, IndexError, ValueError, TypeError) as error:
            self._send({"error": f"a request that the page does not make: {error}"}, HTTPStatus.BAD_REQUEST)

    def _allowed(self) -> tuple[list[str], dict[str, str]] | None:
        """Path below the token, and query, of a request of the page; None of any other."""
        hosts = {f"{name}:{self.server.server_port}" for name in (HOST, "localhost")}
        origin = self.headers.get("Origin")
        url = urllib.parse.urlsplit(self.path)
        token, *path = [urllib.parse.unquote(part) for part in url.path.lstrip("/").split("/")]
        fits = (
            self.headers.get("Host") in hosts
            and (origin is None or origin in {f"http://{host}" for host in hosts})
            and self.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
            and secrets.compare_digest(token.encode(), self.server.token.encode())
        )
        return (path, dict(urllib.parse.parse_qsl(url.query))) if fits else None

    def _get(self, path: list[str], query: dict[str, str]) -> None:
        session = self.server.session
        if len(path) == 1 and path[0] in PAGE:
            name, kind = PAGE[path[0]]
            self._send(files("aatri.measuring").joinpath("page", name).read_bytes(), kind=kind)
        elif path == ["state"]:
            self._send(session.state(int(query.get("known", -1))))
        elif path == ["image"]:
            self._send(session.image(query["image"]))
        elif path == ["point"]:
            self._send(session.point(query["name"]))
        elif path == ["marks"]:
            self._send(session.marks(query["image"]))
        elif path == ["tile"]:
            level, column, row = (int(query[n]) for n in ("level", "column", "row"))
            self._send(session.tile(query["image"], level, column, row), kind="image/png", keep=True)
        else:
            self._send({"error": "there is no such page"}, HTTPStatus.NOT_FOUND)

    def _post(self, path: list[str], _query: dict[str, str]) -> None:
        length = int(self.headers.get("Content-Length", 0))
        if not 0 < length <= LARGEST_BODY or self.headers.get("Content-Type") != "application/json":
            self.close_connection = True
            raise InputError("a request that the page does not make", where="/".join(path))
        arguments, session = json.loads(self.rfile.read(length)), self.server.session
        verbs: dict[str, Callable[..., Values]] = {
            "measure": session.measure,
            "remove": session.remove,
            "undo": session.undo,
            "centre": session.centre,
        }
        self._send(verbs[path[0]](**arguments))

    def _send(
        self,
        answer: dict[str, Any] | bytes,
        status: HTTPStatus = HTTPStatus.OK,
        *,
        kind: str = "application/json",
        keep: bool = False,
    ) -> None:
        body = answer if isinstance(answer, bytes) else json.dumps(answer, allow_nan=False).encode()
        if status is HTTPStatus.FORBIDDEN:
            self.close_connection = True
        self.send_response(status)
        cache = f"private, max-age={TILE_SECONDS}" if keep else "no-store"
        for name, value in {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": cache,
            **HEADERS,
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)


def _sentence(error: AatriError) -> str:
    """An error as one sentence."""
    where = f"{error.where}: " if error.where else ""
    return f"{where}{error.what}" + (f"; {error.remedy}" if error.remedy else "")
