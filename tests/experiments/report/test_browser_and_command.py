"""A report in a real browser, and the command that writes it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

pytest.importorskip("plotly", reason="the report needs the extra 'report'")
pytest.importorskip("jinja2", reason="the report needs the extra 'report'")

from experiments.cli import app
from identification.diagnosis.policy import DecisionPolicy
from identification.diagnosis.verify import verified
from identification.logs.log import write_log
from identification.logs.reading import read_log

from .asking import Page, build, held

SCREENS = [(1200, 800), (400, 800)]


@pytest.mark.parametrize(("width", "height"), SCREENS, ids=["desk", "telephone"])
def test_verdict_size_and_next_step_are_on_the_first_screen(page, checked, examined, tmp_path, width, height):
    """And nothing is asked of any network, nor is the page wider than the screen."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright")
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium on PATH")
    left = build(replace(examined, diagnosis=examined.diagnosis.falling_short(2.4)))
    asked: list[str] = []
    with playwright.sync_playwright() as p:
        opened = p.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = opened.new_page(viewport={"width": width, "height": height})
        tab.on("request", lambda request: asked.append(request.url))
        for number, html in enumerate((page, left, *checked)):
            path = tmp_path / f"{number}.html"
            path.write_text(html, encoding="utf-8")
            tab.goto(path.as_uri())
            for part in (".badge", "h1", ".facts", ".next"):
                box = tab.locator(f"header.verdict {part}").first.bounding_box()
                assert box is not None
                assert box["y"] + box["height"] <= height, (number, part)
            assert "times" in tab.locator("h1").inner_text()
            assert tab.evaluate("document.documentElement.scrollWidth") <= width
            tab.evaluate("document.querySelectorAll('details').forEach((part) => part.open = true)")
            cut = "[...document.querySelectorAll('.scroll')].filter((part) => part.scrollWidth > part.clientWidth + 1)"
            assert tab.evaluate(f"{cut}.length") == 0, (number, "a table is wider than the screen")
            assert tab.locator("nav a").count() >= 3
        opened.close()
    assert [url for url in asked if not url.startswith(("file://" + str(tmp_path), "data:", "blob:"))] == []
    assert len(asked) >= 4


def test_a_page_is_dark_where_the_system_is(page, tmp_path):
    """Words and ticks stand out from what is behind them, before and after a change, and paper stays white."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the browser test needs playwright")
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium on PATH")
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    with playwright.sync_playwright() as p:
        opened = p.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = opened.new_page(color_scheme="dark")
        tab.goto(path.as_uri())

        def brightness(selector: str, what: str) -> float:
            colour = tab.locator(selector).first.evaluate(f"(e) => getComputedStyle(e).{what}")
            return sum(float(x) for x in re.findall(r"[\d.]+", colour)[:3]) / 3.0

        def tick() -> float:
            return brightness(".xtick text", "fill")

        assert brightness("body", "backgroundColor") < 40.0
        assert min(brightness("h1", "color"), tick()) > 180.0
        tab.emulate_media(color_scheme="light")
        # the page's own policy allows no evaluated text, so a locator waits for the figures' new colour
        playwright.expect(tab.locator(".xtick text").first).to_have_css("fill", "rgb(26, 26, 26)")
        assert brightness("body", "backgroundColor") == 255.0
        tab.emulate_media(media="print", color_scheme="dark")
        assert brightness("body", "backgroundColor") == 255.0
        opened.close()


@pytest.mark.timeout(400)
def test_a_browser_draws_every_figure(page, checked, tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no Chromium on PATH: nothing to draw the page with")
    for html in (page, *checked):
        path = tmp_path / "report.html"
        path.write_text(html, encoding="utf-8")
        flags = (
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-logging=stderr",
            "--virtual-time-budget=30000",
        )
        offline = ("--host-resolver-rules=MAP * ~NOTFOUND",)
        run = subprocess.run(
            [browser, *flags, *offline, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", path.as_uri()],
            capture_output=True,
            text=True,
            timeout=300,
        )
        body = run.stdout[run.stdout.index("<main>") :]
        drawn = re.findall(r'<div class="plot js-plotly-plot" id="plot-([^"]+)"', body)
        assert sorted(drawn) == sorted(Page(html).figures)
        assert len(re.findall(r'<svg class="main-svg"', body)) >= len(drawn)
        assert "CONSOLE" not in run.stderr, run.stderr


@pytest.fixture
def files(logs, tmp_path) -> tuple[Path, Path]:
    """Both logs as files."""
    paths = tmp_path / "fitted.csv", tmp_path / "other.csv"
    for path, log in zip(paths, logs, strict=True):
        write_log(path, log)
    return paths


@pytest.fixture
def at_once(monkeypatch, examined) -> None:
    """The search, which is tested elsewhere, is over at once; what the command holds out still judges it."""
    import identification.diagnosis.diagnose as search

    found = replace(examined.diagnosis, gap=None, still_off=1.0)
    monkeypatch.setattr(
        search,
        "diagnose",
        lambda logs, held_out, *args, **options: verified(found, held(*logs, *held_out)),
    )


def test_the_command_writes_all_three_files(files, at_once, tmp_path):
    """Beside what is somebody's own, and in place of what an earlier run left."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "next_experiment.csv").write_text("an earlier run's")
    (out / "report.html").write_text("an earlier run's")
    (out / "mine.txt").write_text("mine")
    arguments = ["diagnose", files[0], "--held-out", files[1], "-o", out]
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in out.iterdir()) == ["diagnosis.json", "mine.txt", "plant.json", "report.html"]
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["gap"]["held_out"] is True
    assert found["gap"]["logs"] == ["other.csv"]
    assert found["policy"] == DecisionPolicy().to_dict()
    assert "closed share" in result.stdout
    assert "other.csv" in (out / "report.html").read_text()


@pytest.mark.parametrize("case", ["same log", "output is a file"])
def test_bad_input_is_refused_before_the_search(files, tmp_path, case):
    out = files[1] if case == "output is a file" else tmp_path / "out"
    held = files[0] if case == "same log" else files[1]
    result = CliRunner().invoke(app, ["diagnose", str(files[0]), "--held-out", str(held), "-o", str(out)])
    assert result.exit_code == 2
    assert {"same log": "hold out a log", "output is a file": "is a file"}[case] in result.stderr
    assert not (tmp_path / "out").exists()
    assert read_log(files[1])
