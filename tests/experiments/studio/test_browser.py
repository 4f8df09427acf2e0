"""The seven views in Debian's Chromium, as somebody meets them; no request leaves the machine, no script fails."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from experiments.studio.drive import served, start_what_if
from experiments.studio.frame import VIEWS
from experiments.studio.work import LONGEST_END
from furuta_gym.plant import Plant
from identification import read_log, write_log
from tests.experiments.studio import narrow

Open = Callable[..., Any]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("working")


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    """A studio that looks for two effects only."""
    names = "arm_spring,input_delay"
    with served(folder, program=Path(narrow.__file__), NARROW=names) as studio:
        yield studio.address


@pytest.fixture
def opened(window: Any, address: str) -> Iterator[Open]:
    """Opens a tab; at its end nothing has left the machine and no script has failed."""
    strange: list[str] = []
    errors: list[str] = []
    pages: list[Any] = []

    def open_page(*files: Path, width: int = 1024) -> Any:
        page = window.new_page(viewport={"width": width, "height": 900})
        pages.append(page)
        page.set_default_timeout(120_000)
        page.on("request", lambda r: None if _own(r.url) else strange.append(r.url))
        page.on("pageerror", lambda e: errors.append(str(e)))
        page.goto(address)
        if files:
            page.locator("input[type=file]").first.set_input_files([str(file) for file in files])
        return page

    yield open_page
    for page in pages:
        page.close()
    assert strange == []
    assert errors == []


def _own(url: str) -> bool:
    return url.startswith(("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:"))


def view(page: Any, name: str) -> None:
    page.get_by_role("tab", name=name, exact=True).click()


def reopened(page: Any) -> Any:
    """A page once the saved session is there."""
    page.get_by_text("Is the model adequate?").wait_for()
    return page


def ratio(page: Any) -> float:
    text = page.locator(".card-value").first.inner_text()
    return float(text.split()[0]) if text.endswith("×") else float("inf")


def wait_for_ratio(page: Any, holds: Callable[[float], bool]) -> float:
    for _ in range(600):
        if holds(found := ratio(page)):
            return found
        page.wait_for_timeout(100)
    raise AssertionError(f"the error over the noise floor stayed at {ratio(page):g}")


def test_log_a_wrong_sign_shows_red_and_the_fix_turns_it_green(opened: Open, spring_log: Path) -> None:
    page = opened(spring_log)
    light = page.locator("tr[data-item=sign_q2] .light")
    light.wait_for()
    before = light.get_attribute("class")
    assert "light-bad" not in before
    page.get_by_role("button", name="Flip the sign of the pendulum").click()
    page.locator("tr[data-item=sign_q2] .light-bad").wait_for()
    assert light.inner_text().endswith("wrong")  # not by colour alone
    assert page.get_by_role("button", name="Use these logs").is_disabled()
    page.get_by_role("button", name="Read zero and signs as the motion shows them").click()
    page.locator("tr[data-item=sign_q2] .light-bad").wait_for(state="hidden")
    assert page.get_by_role("button", name="Use these logs").is_enabled()


def test_diagnose_the_log_of_the_demo_goes_from_drop_to_the_name_of_the_effect(opened: Open, tmp_path: Path) -> None:
    demo = Path(__file__).parents[3] / "experiments" / "demo" / "logs" / "paper.csv"
    write_log(tmp_path / "demo.csv", read_log(demo).slice(stop=6.0))  # a part of it, so that nobody waits
    page = opened(tmp_path / "demo.csv")
    page.get_by_role("button", name="Use these logs").click()
    view(page, "Diagnose")
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.get_by_text("gain so far [nats]").wait_for()
    page.locator("tr[data-suspect=input_delay]").wait_for()
    page.set_viewport_size({"width": 400, "height": 800})
    page.wait_for_function("document.documentElement.clientWidth <= 400")
    assert page.evaluate("(([part]) => part.scrollWidth - part.clientWidth)(document.querySelectorAll('.scroll'))") <= 1
    page.screenshot(path=tmp_path / "suspects.png")
    verdict = page.locator(".verdict")
    verdict.wait_for(timeout=240_000)
    assert "the command reaches the motor" in verdict.inner_text().lower()


def test_identify_by_the_keyboard_alone(opened: Open, spring_log: Path) -> None:
    page = opened(spring_log)
    page.get_by_text("How it is read").wait_for()
    for name in ("Use these logs", "Identify"):
        reach(page, name)
        page.keyboard.press("Enter")
        page.get_by_role("button", name=name, exact=True).wait_for(state="detached")
    page.get_by_text("Is the model adequate?").wait_for()
    assert "not adequate" in page.locator(".main").inner_text()
    reach(page, "What if …")
    page.keyboard.press("Enter")
    reach(page, "Start")
    page.keyboard.press("Enter")
    slider = page.locator("[role=slider]").first
    slider.wait_for()
    before = [s.get_attribute("aria-valuenow") for s in page.locator("[role=slider]").all()]
    for _ in range(100):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.closest('[role=slider]') !== null"):
            break
    page.keyboard.press("ArrowRight")
    page.get_by_text("Slider to picture").wait_for()
    after = [s.get_attribute("aria-valuenow") for s in page.locator("[role=slider]").all()]
    assert sum(a != b for a, b in zip(after, before, strict=True)) == 1


def reach(page: Any, text: str) -> None:
    """Press Tab until the focus is on a button."""
    page.get_by_role("button", name=text, exact=True).wait_for()
    for _ in range(80):
        if page.evaluate("(document.activeElement.textContent || '').trim()").endswith(text):
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"the keyboard does not reach {text!r}")


def test_what_if_the_hidden_effect_at_its_fitted_size_brings_the_error_to_the_floor(
    opened: Open, session_file: Path, with_spring: Plant
) -> None:
    page = reopened(opened(session_file, width=1440))
    start_what_if(page)
    wait_for_ratio(page, lambda r: r < 1.3)
    number = page.locator(".effect .slider-number input").first
    number.fill("0")
    number.press("Tab")
    assert wait_for_ratio(page, lambda r: r > 1.9) < float("inf")
    spring = with_spring.effect("arm_spring")
    assert spring is not None
    slide(page, spring.parameters["k"])
    page.get_by_text("Slider to picture").wait_for()
    wait_for_ratio(page, lambda r: r < 1.3)
    took = float(page.evaluate("Math.min(...studio.pictures.map((picture) => picture.took))"))
    assert 0 < took < 5000  # it is measured; how fast it is says `python -m experiments.studio.speed --browser`


def slide(page: Any, value: float) -> None:
    """Drag the slider of the first parameter of the first effect to a value."""
    track = page.locator(".effect .q-slider__track-container").first
    thumb = page.locator(".effect [role=slider]").first
    low, high = (float(thumb.get_attribute(f"aria-value{end}")) for end in ("min", "max"))
    track.scroll_into_view_if_needed()
    box = track.bounding_box()
    y = box["y"] + box["height"] / 2
    at = (float(thumb.get_attribute("aria-valuenow")) - low) / (high - low)
    page.mouse.move(box["x"] + at * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + (value - low) / (high - low) * box["width"], y, steps=8)
    page.mouse.up()


def test_residuals_of_a_stretch_of_time(opened: Open, session_file: Path) -> None:
    page = reopened(opened(session_file))
    view(page, "Residuals")
    page.get_by_role("button", name="Show what is missing").click()
    page.get_by_text("The same samples against a variable").wait_for()
    stretch = page.get_by_text("Stretch of time:")
    before = stretch.inner_text()
    page.locator(".q-range [tabindex]").first.focus()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "before => [...document.querySelectorAll('.card-meaning')].every(e => e.innerText !== before)", arg=before
    )
    assert "Spring" not in page.locator(".main").inner_text()


def test_play_a_push_moves_the_arm_of_the_closed_loop(opened: Open, session_file: Path) -> None:
    page = reopened(opened(session_file))
    view(page, "Play")
    page.get_by_role("button", name="Closed loop").click()
    page.get_by_role("button", name="Play", exact=True).click()
    state = page.get_by_text("from upright")
    state.wait_for()
    page.wait_for_function("() => parseFloat(document.querySelector('[role=status].card-meaning').innerText) > 1")
    for theme in ("light", "dark"):
        page.emulate_media(color_scheme=theme)
        page.wait_for_timeout(400)
        assert page.evaluate(CONTRAST) == [], theme
    page.get_by_role("button", name="Push right").click()
    page.wait_for_function(
        "() => Math.abs(parseInt(document.querySelector('[role=status].card-meaning')"
        ".innerText.split('command')[1])) > 8"
    )
    hand = page.locator('[aria-label^="Push: hold"]')
    box = hand.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + box["height"] / 2, steps=4)
    page.mouse.up()
    page.wait_for_function("() => +document.querySelector('[role=slider][aria-valuemin=\"-1\"]').ariaValueNow === 0")
    late = page.locator('[aria-label="Delay of the command [ms]"]').bounding_box()
    page.mouse.click(late["x"] + late["width"] - 3, late["y"] + late["height"] / 2)  # 0.1 s, which no LQR stands
    page.get_by_text("It fell after").wait_for()


def test_export_writes_and_the_session_is_opened_again(
    opened: Open, session_file: Path, folder: Path, with_spring: Plant
) -> None:
    page = reopened(opened(session_file))
    view(page, "Export")
    for name in ("rig.toml", "rig.json", "plant.json", "controller.h", "session.sh", "session.furuta"):
        page.get_by_role("button", name=f"Write {name}").click()
        page.get_by_text(f"Written: {folder / name}").wait_for()
        assert (folder / name).stat().st_size > 50
    page.get_by_role("button", name="Write plant.xml").click()
    page.get_by_text("no rigid body has these parameters").wait_for()  # what cannot be written is a sentence
    assert not (folder / "plant.xml").exists()
    assert Plant.load(folder / "plant.json").theta == pytest.approx(with_spring.theta)
    again = reopened(opened(folder / "session.furuta"))
    view(again, "Export")
    again.get_by_role("button", name="Write plant.json").wait_for()


@pytest.mark.parametrize("name", ["Identify", "Diagnose"])
def test_ctrl_c_ends_the_studio_while_it_fits_or_searches(
    window: Any, spring_log: Path, tmp_path: Path, name: str
) -> None:
    with served(tmp_path) as studio:
        page = window.new_page()
        page.goto(studio.address)
        page.locator("input[type=file]").first.set_input_files(str(spring_log))
        page.get_by_role("button", name="Use these logs").click()
        view(page, name)
        page.get_by_role("button", name=name, exact=True).click()
        page.locator(".doing").wait_for()
        studio.process.send_signal(signal.SIGINT)
        assert studio.process.wait(LONGEST_END + 17.0) == 130
        page.close()


CONTRAST = (Path(__file__).parent / "contrast.js").read_text(encoding="utf-8")


def test_text_stands_out_and_no_view_is_wider_than_a_telephone(opened: Open, session_file: Path) -> None:
    page = reopened(opened(session_file))
    for name in VIEWS:
        page.set_viewport_size({"width": 1024, "height": 900})
        view(page, name)
        for theme in ("light", "dark"):  # the page follows the system
            page.emulate_media(color_scheme=theme)
            page.wait_for_timeout(400)
            assert (ground(page) > 128) == (theme == "light")
            assert page.evaluate(CONTRAST) == [], (name, theme)
        page.set_viewport_size({"width": 400, "height": 800})
        page.wait_for_function("document.documentElement.clientWidth <= 400")  # the page is laid out anew
        page.wait_for_timeout(200)
        assert page.evaluate("document.documentElement.scrollWidth") <= 400, name


def ground(page: Any) -> int:
    """How light the page is, of 255."""
    return int(page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0]"))


def test_the_contrast_is_measured(opened: Open) -> None:
    page = opened()
    page.get_by_text("No log yet").wait_for()
    assert page.evaluate(CONTRAST) == []
    page.add_style_tag(content=".message { color: #949494 !important; }")  # 3.0 on white
    assert page.evaluate(CONTRAST) != []
