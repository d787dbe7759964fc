"""The report in a real browser: nothing from outside, keys, deep links, light and dark."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, sync_playwright
from run_on_paper import COLORS, HOSTILE, LEFT, REFINED, write_run

from unilavira_drake.cli.main import main

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
pytestmark = pytest.mark.skipif(
    CHROMIUM is None,
    reason="no Chromium here; install Debian's: apt-get install -y chromium",
)
IDS = ["overview", *(f"step={n}" for n in range(1, 7))]


@dataclass
class Visit:
    """A page with all that it complained about and asked for."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def shown(self) -> list[str]:
        return [
            page.get_attribute("id") or ""
            for page in self.page.query_selector_all(".page")
            if page.is_visible()
        ]

    def hash(self) -> str:
        return str(self.page.evaluate("location.hash"))

    def image(self, selector: str) -> NDArray[np.uint8]:
        png = self.page.locator(selector).screenshot()
        image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        return np.asarray(image[:, :, ::-1], np.uint8)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_run(tmp_path_factory.mktemp("chromium") / "run")
    assert main(["report", str(folder)]) == 0
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM)
        yield chromium
        chromium.close()


class Opener:
    """Opens the report in a context of its own."""

    def __init__(self, browser: Browser, report: Path) -> None:
        self._browser = browser
        self._report = report
        self.visits: list[Visit] = []

    def __call__(
        self,
        fragment: str = "",
        *,
        width: int = 1400,
        scheme: Literal["light", "dark"] = "light",
        javascript: bool = True,
    ) -> Visit:
        context = self._browser.new_context(
            viewport={"width": width, "height": 900},
            color_scheme=scheme,
            java_script_enabled=javascript,
        )
        visit = Visit(context.new_page())
        visit.page.on("console", lambda message: visit.complaints.append(message.text))
        visit.page.on("pageerror", lambda error: visit.complaints.append(str(error)))
        visit.page.on("request", lambda request: visit.requests.append(request.url))
        visit.page.goto(f"{self._report.as_uri()}{fragment}")
        self.visits.append(visit)
        return visit


@pytest.fixture
def visit(browser: Browser, report: Path) -> Iterator[Opener]:
    """Opens the page; after every test nothing was complained of and nothing else was asked for."""
    opener = Opener(browser, report)
    yield opener
    for one in opener.visits:
        one.page.context.close()
        assert one.complaints == []
        outside = [url for url in one.requests if not url.startswith("data:")]
        assert {url.partition("#")[0] for url in outside} == {report.as_uri()}


def test_it_opens_on_the_overview(visit: Opener) -> None:
    one = visit()
    assert one.shown() == ["overview"]
    assert one.page.locator(".timeline a").count() == len(IDS)
    assert one.page.locator(".timeline a[aria-current]").inner_text() == "Overview"


def test_the_arrow_keys_walk_through_all_steps(visit: Opener) -> None:
    one = visit()
    one.page.keyboard.press("ArrowLeft")
    assert one.shown() == ["overview"]
    for expected in IDS[1:]:
        one.page.keyboard.press("ArrowRight")
        one.page.wait_for_function(f"location.hash === '#{expected}'")
        assert one.shown() == [expected]
        focused = one.page.evaluate("document.activeElement.closest('.page').id")
        assert focused == expected
    one.page.keyboard.press("ArrowRight")
    assert one.hash() == f"#{IDS[-1]}"
    one.page.keyboard.press("ArrowLeft")
    one.page.wait_for_function(f"location.hash === '#{IDS[-2]}'")
    assert one.shown() == [IDS[-2]]
    one.page.keyboard.press("Control+ArrowLeft")
    assert one.hash() == f"#{IDS[-2]}"


def test_a_deep_link_opens_its_step_and_back_returns(visit: Opener) -> None:
    one = visit("#step=5")
    assert one.shown() == ["step=5"]
    assert "drive back to waypoint 1" in one.page.locator("#step\\=5 h2").inner_text()
    one.page.locator("#step\\=5 [rel=next]").click()
    assert (one.shown(), one.hash()) == (["step=6"], "#step=6")
    one.page.locator(".timeline a", has_text="write the plan").click()
    assert (one.shown(), one.hash()) == (["step=1"], "#step=1")
    one.page.go_back()
    one.page.wait_for_function("location.hash === '#step=6'")
    assert one.shown() == ["step=6"]
    assert visit("#step=99").shown() == ["overview"]


def test_a_script_in_a_reply_stays_text(visit: Opener) -> None:
    one = visit("#step=2")
    one.page.locator("#step\\=2 details summary").first.click()
    assert one.page.locator("#step\\=2 pre").first.inner_text() == f"no JSON {HOSTILE}"
    assert HOSTILE in one.page.locator("#step\\=2 .reasoning").inner_text()
    assert one.page.evaluate("window.hacked") is None
    assert one.page.locator("script").count() == 1
    assert one.page.locator("img").count() == 0


def test_the_policy_stops_what_is_not_the_page_s_own(visit: Opener) -> None:
    one = visit()
    one.page.evaluate(
        """() => {
          const script = document.createElement("script");
          script.textContent = "window.hacked = 3";
          document.body.append(script);
          const image = document.createElement("img");
          image.src = "https://example.org/x.png";
          document.body.append(image);
        }"""
    )
    one.page.wait_for_timeout(200)
    assert one.page.evaluate("window.hacked") is None
    assert len(one.complaints) == 2
    assert all("Content Security Policy" in complaint for complaint in one.complaints)
    one.complaints.clear()
    # Refused before it left.
    one.requests[:] = [url for url in one.requests if "example.org" not in url]


def test_views_and_marks_are_really_drawn(visit: Opener) -> None:
    one = visit("#step=2")
    views = one.page.locator("#step\\=2 .view")
    captions = [caption.split() for caption in views.locator("figcaption").all_inner_texts()]
    assert captions == [["left", "chosen"], ["front"], ["right"], ["back"]]
    for caption, color in zip(captions, ("left", "front", "right", "back"), strict=True):
        selector = f"#step\\=2 .view:nth-child({captions.index(caption) + 1}) .picture"
        image = one.image(selector)
        np.testing.assert_allclose(image[8, 8], COLORS[color], atol=12)
    target = one.image("#step\\=2 .target .picture")
    scale = target.shape[1] / 640
    # The box from (100, 120) to (300, 330), in orange, and the pixel (200, 225), in cyan.
    orange, cyan = (255, 138, 31), (53, 224, 255)
    for (u, v), color in (
        ((150, 120), orange),
        ((100, 300), orange),
        ((300, 200), orange),
        ((200, 225), cyan),
        ((215, 225), cyan),
    ):
        np.testing.assert_allclose(target[round(v * scale), round(u * scale)], color, atol=40)


def test_the_refined_mark_is_drawn_beside_the_model_s(visit: Opener) -> None:
    one = visit("#step=2")
    magenta = np.array((255, 107, 241))

    def drawn(selector: str, box: tuple[float, float, float, float]) -> float:
        """The share of a box's upper edge in the color of the grounder."""
        image = one.image(selector).astype(int)
        u0, v0, u1, _ = np.array(box) * image.shape[1] / 640
        edge = image[round(v0) - 1 : round(v0) + 2, round(u0) + 4 : round(u1) - 4]
        return float((np.abs(edge - magenta).max(axis=2) < 60).any(axis=0).mean())

    target, view = "#step\\=2 .target .picture", "#step\\=2 .view.chosen .picture"
    # Dashes, and dots for what was not taken; these in the large picture only.
    assert 0.4 < drawn(target, REFINED) < 0.9
    assert 0.1 < drawn(target, LEFT) < 0.6
    assert drawn(view, REFINED) > 0.2
    assert drawn(view, LEFT) == 0.0
    keys = one.page.locator("#step\\=2 .target .key")
    styles = keys.evaluate_all("keys => keys.map(key => getComputedStyle(key).borderTopStyle)")
    assert styles == ["solid", "dashed", "dotted", "none"]


def test_the_list_shows_its_changes(visit: Opener) -> None:
    one = visit("#step=2")
    items = one.page.locator("#step\\=2 .todo li")
    texts = [" ".join(text.split()) for text in items.all_inner_texts()]
    assert texts[0] == "✓ Leave the bedroom completed the corridor underfoot"
    assert texts[1] == "○ Enter the hall completion rolled back"
    assert texts[2] == "○ Pass the bench"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
def test_it_renders_light_and_dark_wide_and_narrow(
    visit: Opener, scheme: Literal["light", "dark"], width: int, tmp_path: Path
) -> None:
    one = visit(width=width, scheme=scheme)
    for name in IDS:
        one.page.evaluate(f"location.hash = '{name}'")
        one.page.wait_for_function(f"!document.getElementById('{name}').hidden")
        # Nothing has to be scrolled sideways.
        assert one.page.evaluate("document.documentElement.scrollWidth") <= width
    path = tmp_path / f"{scheme}-{width}.png"
    one.page.screenshot(path=path, full_page=True)
    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape[1] == width
    paper = image[2, 2].mean()
    assert paper > 200 if scheme == "light" else paper < 60
    # The map has walls, a way and words: many colours in each scheme.
    assert len(np.unique(one.image("#step\\=6 .map").reshape(-1, 3), axis=0)) > 50


def test_without_scripts_every_step_is_there(visit: Opener) -> None:
    one = visit(javascript=False)
    assert one.shown() == IDS


def test_it_can_be_walked_with_a_screen_reader(visit: Opener) -> None:
    one = visit("#step=2")
    tree = one.page.locator("#step\\=2").aria_snapshot()
    for words in ("left view, chosen", "front view", "Map at step 2", "What it saw", "TODO list"):
        assert words in tree
    one.page.keyboard.press("Tab")
    assert one.page.evaluate("document.activeElement.tagName") == "A"
