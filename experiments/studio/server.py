"""How the page is served: on this machine only, under an address that nobody guesses, with files of a bounded size."""

from __future__ import annotations

import asyncio
import secrets
import shutil
import socket
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Thread

from nicegui import app, background_tasks, ui
from nicegui.server import Server
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from furuta_gym.processes import temporary_folder
from identification import RigMapping

from . import LARGEST_FILE, MOST_FILES
from .frame import close_all
from .page import draw, load
from .work import end_soon, keep_little

HOST = "127.0.0.1"
MOST_SENT = MOST_FILES * LARGEST_FILE + 1_000_000  # bytes of a request: files dropped together, and the form's own
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws:; object-src 'none'; base-uri 'self'; "
    "form-action 'self'; frame-ancestors 'none'"
)
"""Content security policy: the browser itself refuses every address outside the machine."""


def free_port() -> int:
    """A port that nobody uses."""
    with socket.socket() as s:
        s.bind((HOST, 0))
        return int(s.getsockname()[1])


def require_free(port: int) -> None:
    """Raises ValueError where somebody listens at a port already, or it may not be used."""
    with socket.socket() as s:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does: a port just left is free
        try:
            s.bind((HOST, port))
        except OSError as error:
            raise ValueError(
                f"--port {port}: {error.strerror}. Expected a free port; without --port one is found"
            ) from None


def refusal(host: str, method: str, length: str | None, origin: str | None = None) -> tuple[int, str] | None:
    """Why a request is refused: status and sentence, or None. host, length, origin: its headers."""
    name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
    if name not in (HOST, "localhost"):
        return 403, f"furuta studio answers to {HOST} only"
    if origin not in (None, f"http://{host}"):  # by the host's name, as a tunnel's port is not the server's
        return 403, "furuta studio answers to its own page only"
    if method in ("POST", "PUT", "PATCH"):
        if length is None or not length.isdigit():
            return 411, "the size of the upload is missing"
        if int(length) > MOST_SENT:  # on its way it is kept in files, not in memory
            return 413, f"expected at most {MOST_FILES} files of {LARGEST_FILE} bytes"
    return None


class Guard:
    """Around the whole application, its sockets too: refuses strangers, and says what the browser may load."""

    def __init__(self, inside: ASGIApp) -> None:
        self.inside = inside

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def with_policy(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["Content-Security-Policy"] = POLICY
                headers["Referrer-Policy"] = "no-referrer"
                headers["X-Content-Type-Options"] = "nosniff"
            await send(message)

        if scope["type"] in ("http", "websocket"):
            told = Headers(scope=scope)
            host, length, origin = told.get("host", ""), told.get("content-length"), told.get("origin")
            if refused := refusal(host, scope.get("method", "GET"), length, origin):
                status, why = refused
                answer = Response(why, status) if scope["type"] == "http" else WebSocketClose(1008, why)
                await answer(scope, receive, send)
                return
        await self.inside(scope, receive, with_policy)


def register(folder: Path, logs: Sequence[Path], stated: RigMapping | None = None, token: str | None = None) -> str:
    """Add the page to the application and give its path, which holds the token. stated: how logs are read."""
    token = token or secrets.token_urlsafe(24)
    path = f"/{token}/"

    app.add_middleware(Guard)

    @ui.page(path, title="furuta studio", dark=None)
    async def page() -> None:
        await draw(folder, logs, stated)

    return path


def open_in_browser(address: str, folder: Path) -> None:
    """Open an address in the user's browser by a page that only this user may read, and that leads there.

    The browser is started with that page, as other users of the machine see what programs are started with."""
    page = folder / "open.html"
    page.touch(mode=0o600)
    page.write_text(f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={address}">')
    webbrowser.open(page.as_uri())


def end(folder: Path) -> None:
    """Interrupted: end what is computed, and delete what lies outside the working folder, before the process ends."""
    close_all()
    shutil.rmtree(folder, ignore_errors=True)
    end_soon()


def serve(
    logs: Sequence[Path],
    port: int | None,
    show: bool,
    told: Callable[[str], None],
    stated: RigMapping | None = None,
) -> None:
    """Serve until interrupted, and end what is computed then. told: called with the address once the server listens.
    stated: how logs are read, in place of any rig.toml.

    Raises ValueError where the port is taken."""
    if port is not None:
        require_free(port)
    port = port or free_port()
    keep_little()
    path = register(Path.cwd(), [log.resolve() for log in logs], stated)

    async def tell() -> None:
        while not Server.instance.started:  # start-up ends before the port is bound, or found taken
            await asyncio.sleep(0.01)
        address = f"http://{HOST}:{port}{path}"
        told(address)
        if show:
            Thread(target=open_in_browser, args=(address, folder), daemon=True).start()

    app.on_startup(lambda: background_tasks.create(tell()))
    app.on_startup(lambda: Thread(target=load, daemon=True).start())
    with temporary_folder("studio") as folder:
        app.on_shutdown(lambda: end(folder))
        ui.run(
            host=HOST,
            port=port,
            show=False,
            reload=False,
            title="furuta studio",
            show_welcome_message=False,
            tailwind=False,
            reconnect_timeout=30.0,
            favicon="📐",
            uvicorn_logging_level="error",
        )
