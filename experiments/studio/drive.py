"""The studio as a process, and a browser that looks at it: for measurements and tests."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from furuta_gym.extras import install

LONGEST_WAIT = 180_000  # ms, for a computation that a click starts


@dataclass(frozen=True)
class Served:
    """A running studio: its address, and the process."""

    address: str
    process: subprocess.Popen[str]


@contextmanager
def served(
    folder: Path,
    *logs: Path,
    program: Path | None = None,
    errors: Path | None = None,
    show: bool = False,
    **variables: str,
) -> Iterator[Served]:
    """`furuta studio LOG… --no-browser` as a process in a folder, until the end of the block.

    program: what is run in place of `furuta`. errors: where its standard error goes. show: without --no-browser.
    variables: of its environment."""
    root = Path(__file__).resolve().parents[2]
    program = program or root / "furuta_command.py"
    command = [sys.executable, str(program), "studio", *map(str, logs), *([] if show else ["--no-browser"])]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST")}
    environment |= {"PYTHONPATH": str(root), **variables}
    with open(errors or os.devnull, "wb") as told:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=told,
            text=True,
            # a shell lets what it runs in the background ignore SIGINT, and that is inherited
            preexec_fn=None if os.name == "nt" else lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        if not address.startswith("http://127.0.0.1:"):
            raise ValueError(f"furuta studio did not start: it printed {address!r}")
        yield Served(address, process)
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()


def chromium() -> str | None:
    """Where Chromium is on this machine."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium without a window, driven by Playwright. Raises ValueError, which says what is missing."""
    found = chromium()
    if found is None:
        raise ValueError("no Chromium is installed; on Debian: apt install chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise ValueError(f"no Playwright is installed: {install('dev')}") from None
    with sync_playwright() as playwright:
        window = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        try:
            yield window
        finally:
            window.close()


def fit_in(page: Any) -> None:
    """Take the logs as they are read and fit model (5), as a user does."""
    page.set_default_timeout(LONGEST_WAIT)
    page.get_by_role("button", name="Use these logs").click()
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_text("Is the model adequate?").wait_for()


def start_what_if(page: Any) -> None:
    """Open the view What if on the first window."""
    page.get_by_role("tab", name="What if").click()
    page.get_by_role("button", name="Start", exact=True).click()
    page.locator(".chart.live canvas").first.wait_for()
