"""Who is served, and what the browser may load."""

from __future__ import annotations

import base64
import os
import socket
import time
from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

import httpx
import pytest

from experiments.studio import LARGEST_FILE, MOST_FILES
from experiments.studio.drive import served
from experiments.studio.server import HOST, POLICY, refusal
from tests.experiments.studio import late
from tests.studio import serving


@pytest.mark.parametrize(
    ("host", "method", "length", "status"),
    [
        ("127.0.0.1:8000", "GET", None, None),
        ("localhost:8000", "POST", "100", None),
        ("evil.example:8000", "GET", None, 403),  # a name that was pointed at this machine
        ("127.0.0.1.evil.example", "GET", None, 403),
        ("test", "GET", None, 403),
        ("", "GET", None, 403),
        ("127.0.0.1:8000", "POST", str(MOST_FILES * LARGEST_FILE), None),  # all logs of a session dropped together
        ("127.0.0.1:8000", "POST", None, 411),
        ("127.0.0.1:8000", "POST", "-1", 411),
        ("127.0.0.1:8000", "POST", str(MOST_FILES * LARGEST_FILE + 2_000_000), 413),
    ],
)
def test_strange_requests_are_refused(host: str, method: str, length: str | None, status: int | None) -> None:
    assert (refusal(host, method, length) or (None,))[0] == status


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("127.0.0.1:8000", "http://127.0.0.1:8000", None),
        ("localhost:9000", "http://localhost:9000", None),  # through a tunnel from another port
        ("127.0.0.1:8000", "http://evil.example", 403),
        ("127.0.0.1:8000", "http://127.0.0.1:9000", 403),  # another server of this machine
        ("127.0.0.1:8000", "https://127.0.0.1:8000", 403),
        ("127.0.0.1:8000", "null", 403),
        ("evil.example:8000", "http://evil.example:8000", 403),
    ],
)
def test_other_pages_are_refused(host: str, origin: str, status: int | None) -> None:
    assert (refusal(host, "GET", None, origin) or (None,))[0] == status


def upgraded(port: int, host: str, origin: str) -> bytes:
    """The first line of the answer to a browser that asks for a WebSocket."""
    key = base64.b64encode(os.urandom(16)).decode()
    lines = [
        "GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1",
        *(f"Host: {host}", f"Origin: {origin}", "Upgrade: websocket", "Connection: Upgrade"),
        *(f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", "", ""),
    ]
    with socket.create_connection((HOST, port), timeout=30.0) as s:
        s.sendall("\r\n".join(lines).encode())
        return s.recv(4000).split(b"\r\n")[0]


def test_what_the_page_sends_by_itself_is_refused_to_others(tmp_path: Path) -> None:
    with serving(tmp_path) as address, httpx.Client(trust_env=False, timeout=30.0) as client:
        root = address.rsplit("/", 2)[0]
        port = int(root.rsplit(":", 1)[1])
        own, evil = f"{HOST}:{port}", "evil.example"
        for host, origin, welcome in (
            (own, f"http://{own}", True),
            (f"localhost:{port}", f"http://localhost:{port}", True),
            (own, f"http://{evil}", False),
            (evil, f"http://{evil}", False),
        ):
            polled = client.get(
                f"{root}/_nicegui_ws/socket.io/?EIO=4&transport=polling", headers={"host": host, "origin": origin}
            )
            assert polled.status_code == (200 if welcome else 403)
            assert ("access-control-allow-origin" in polled.headers) is welcome
            assert (b" 101 " if welcome else b" 403 ") in upgraded(port, host, origin)


def test_the_page_is_behind_its_token_and_asks_nobody_else(tmp_path: Path) -> None:
    with serving(tmp_path) as address, httpx.Client(trust_env=False, timeout=30.0) as client:
        base, token = address.split("/", 3)[:3], address.rstrip("/").rsplit("/", 1)[1]
        root = "/".join(base)
        assert len(token) > 30
        page = client.get(address)
        assert page.status_code == 200
        assert page.headers["content-security-policy"] == POLICY
        assert "https://" not in page.text
        assert "http://" not in page.text.replace(root, "")
        for wrong in ("/", "/wrong-token/", f"/{token[:-3]}/"):
            assert client.get(root + wrong).status_code == 404
        assert client.get(address, headers={"host": "evil.example"}).status_code == 403
        assert client.post(address, content=iter([b"x"])).status_code == 411  # a size that nobody says
    assert list(tmp_path.iterdir()) == []


def test_the_address_is_told_once_the_server_listens(tmp_path: Path) -> None:
    with served(tmp_path, program=Path(late.__file__)) as studio, httpx.Client(trust_env=False, timeout=30.0) as client:
        assert client.get(studio.address).status_code == 200  # at the first try


@pytest.mark.skipif(os.name == "nt", reason="the browser is a shell script")
def test_no_program_is_started_with_the_token(tmp_path: Path) -> None:
    """The browser is a program that notes its arguments."""
    note, browser = tmp_path / "arguments", tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\nprintf "%s " "$@" > {note}.new && mv {note}.new {note}\n')
    browser.chmod(0o700)
    with served(tmp_path, show=True, BROWSER=str(browser)) as studio:
        for _ in range(200):
            if note.exists():
                break
            time.sleep(0.05)
        (told,) = note.read_text().split()
        page = Path(url2pathname(urlparse(told).path))
        assert studio.address.rstrip("/").rsplit("/", 1)[1] not in told
        assert studio.address in page.read_text()
        assert page.stat().st_mode & 0o077 == 0
    assert not page.exists()


def test_a_port_that_is_taken_is_refused() -> None:
    from tests.commands import furuta, refused

    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen()
        port = other.getsockname()[1]
        refused(furuta("studio", "--port", port, "--no-browser"), f"--port {port}", "in use", "without --port")


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.commands import furuta, refused

    monkeypatch.setattr("experiments.studio.find_spec", lambda name: None)
    refused(furuta("studio"), "NiceGUI", "pip install '.[studio]'")


def test_a_log_that_is_not_there_is_refused() -> None:
    from tests.commands import furuta, refused

    refused(furuta("studio", "nowhere.csv"), "nowhere.csv")
