"""The page in a browser: where a click lands, two tabs, undo, marks; nothing is loaded from elsewhere or complained of.

Needs playwright and a Chromium on the machine; `pip install 'aatri[browser]'`.
"""

from __future__ import annotations

import math
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.measuring.server import MeasuringServer
from aatri.measuring.session import Session
from tests.measuring.made_folder import CROSSES, HEIGHT, WIDTH, made_folder

cv2 = pytest.importorskip("cv2", reason="works on images need the extra `images`")

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")]
MEANT_PX = 0.02


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield running
        running.close()


@pytest.fixture
def server(tmp_path: Path) -> Iterator[MeasuringServer]:
    running = MeasuringServer(Session(made_folder(tmp_path / "block")))
    thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield running
    running.shutdown()
    thread.join()
    running.server_close()


def _opened(browser: Any, server: MeasuringServer, **options: Any) -> tuple[Any, list[str]]:
    """The page with image a, and what it asks of others or complains of."""
    page, complaints = browser.new_page(**({"viewport": {"width": 1400, "height": 850}} | options)), list[str]()
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda r: None if r.url.startswith((server.address, "data:")) else complaints.append(r.url))
    page.goto(server.address)
    page.locator("#place", has_text=f"{WIDTH} ×").wait_for()
    return page, complaints


def _chosen(page: Any, name: str) -> None:
    page.locator("#names button", has_text=name).click()
    page.locator("#chosen", has_text=name).wait_for()


def _on_screen(page: Any, x: float, y: float, zoom: float) -> tuple[float, float]:
    """Where a place is on the screen after the whole image has been enlarged about it by the wheel."""
    page.locator("#canvas").focus()
    page.keyboard.press("f")
    box = page.locator("#canvas").bounding_box()
    whole = min(box["width"] / WIDTH, box["height"] / HEIGHT)
    u = box["x"] + box["width"] / 2 + (x - WIDTH / 2) * whole
    v = box["y"] + box["height"] / 2 + (y - HEIGHT / 2) * whole
    page.mouse.move(u, v)
    now = whole
    while now < 0.9 * zoom:  # a screen with more pixels takes more turns of the wheel
        page.mouse.wheel(0, -math.log(zoom / now) / 0.002)
        page.wait_for_timeout(300)
        now = float(page.inner_text("#place").partition("zoom ")[2].partition(",")[0])
    return u, v


def _clicked(page: Any, x: float, y: float, zoom: float) -> None:
    page.mouse.click(*_on_screen(page, x, y, zoom))
    page.locator("#message", has_text="written").wait_for()


@pytest.mark.parametrize(("sharp", "zoom"), [(1, 8.2), (1, 27.3), (2, 16.0), (1.5, 9.0)])
def test_a_click_lands_where_it_was_meant(browser: Any, server: MeasuringServer, sharp: float, zoom: float) -> None:
    """The one white pixel of a black picture is looked for on a screenshot, and clicked beside."""
    white = (333, 222)
    picture = np.zeros((HEIGHT, WIDTH), np.uint8)
    picture[white[1], white[0]] = 255
    cv2.imwrite(server.session.folder.path["a"], picture)
    page, complaints = _opened(browser, server, device_scale_factor=sharp)
    _chosen(page, "G1")
    u, v = _on_screen(page, white[0] + 0.5, white[1] + 0.5, zoom)
    page.mouse.move(0, 0)
    page.wait_for_timeout(500)
    shot = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE).astype(float)
    rows, columns = np.indices(shot.shape)
    near = np.hypot(columns / sharp - u, rows / sharp - v) < 60
    shot = np.where(near & (shot > 128), 1.0, 0.0)
    zoom = float(np.sqrt(shot.sum())) / sharp
    assert zoom >= 8.0
    seen = (np.array([(columns * shot).sum(), (rows * shot).sum()]) / shot.sum() + 0.5) / sharp
    at = np.round(seen + np.array([7, -5]))
    page.mouse.click(*at)
    page.locator("#message", has_text="written").wait_for()
    meant = np.array(white) + 0.5 + (at - seen) / zoom
    assert server.session.folder.points.of_name("G1")[0].xy == pytest.approx(tuple(meant), abs=MEANT_PX)
    assert complaints == []


def test_to_the_centre_keys_and_undo(browser: Any, server: MeasuringServer) -> None:
    page, complaints = _opened(browser, server)
    table = server.session.folder.points
    _chosen(page, "G1")
    page.check("#snap")
    x, y = CROSSES["a"]
    _clicked(page, x + 3, y - 2, 8.0)
    assert table.of_name("G1")[0].xy == pytest.approx((x, y), abs=0.05)
    first = table.of_name("G1")[0].xy
    page.locator("#canvas").focus()
    page.keyboard.press("ArrowRight")
    page.locator("#message", has_text=f"x {first[0] + 0.1:.3f}").wait_for()
    page.keyboard.press("Shift+ArrowUp")
    page.locator("#message", has_text=f"y {first[1] - 1.0:.3f}").wait_for()
    for expected in ((first[0] + 0.1, first[1]), first):
        page.keyboard.press("u")
        page.locator("#message", has_text="as it was before").wait_for()
        page.wait_for_timeout(400)
        assert table.of_name("G1")[0].xy == pytest.approx(expected, abs=1e-3)
    page.keyboard.press("Delete")
    page.locator("#message", has_text="taken out").wait_for()
    assert table.path.read_text() == "image,point,x,y\n"
    assert complaints == []


def test_a_late_answer_does_not_undo_what_has_been_written_since(
    browser: Any, server: MeasuringServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first answer after a click is from before the arrow key, and arrives after it."""
    page, complaints = _opened(browser, server)
    table, image = server.session.folder.points, server.session.image
    _chosen(page, "G1")
    asked, let_go = threading.Event(), threading.Event()

    def image_later(*arguments: Any) -> Any:
        told = image(*arguments)
        if table.of_name("G1") and not asked.is_set():
            asked.set()
            let_go.wait(30)
        return told

    monkeypatch.setattr(server.session, "image", image_later)
    _clicked(page, *CROSSES["a"], 8.0)
    assert asked.wait(30)
    first = table.of_name("G1")[0].xy
    page.keyboard.press("ArrowRight")
    page.locator("#message", has_text=f"x {first[0] + 0.1:.3f}").wait_for()
    page.wait_for_timeout(500)
    let_go.set()
    page.wait_for_timeout(500)
    page.keyboard.press("Shift+ArrowUp")
    page.locator("#message", has_text=f"y {first[1] - 1.0:.3f}").wait_for(timeout=5000)
    assert table.of_name("G1")[0].xy == pytest.approx((first[0] + 0.1, first[1] - 1.0), abs=1e-3)
    assert complaints == []


def test_two_tabs_see_each_other_and_a_conflict_is_told(browser: Any, server: MeasuringServer) -> None:
    one, _ = _opened(browser, server)
    other, _ = _opened(browser, server)
    for page in (one, other):
        _chosen(page, "G1")
    _clicked(one, 100.0, 100.0, 8.0)
    other.locator("#names button", has_text="control · 1").wait_for()  # heard without a word
    table = server.session.folder.points
    line = table.of_name("G1")[0].line
    other.route("**/state*", lambda route: route.abort())  # this tab hears no more
    one.mouse.click(*_on_screen(one, 120.0, 100.0, 8.0))
    for _ in range(100):
        one.wait_for_timeout(50)
        if table.of_name("G1")[0].line != line:
            break
    kept = table.path.read_text()
    other.mouse.click(*_on_screen(other, 300.0, 200.0, 8.0))
    other.locator("#message.bad").wait_for()
    assert table.path.read_text() == kept


def test_a_missing_picture_is_told_and_a_new_point_taken(browser: Any, server: MeasuringServer) -> None:
    page, _ = _opened(browser, server)
    page.select_option("#image", "c")
    page.locator("#message.bad", has_text="gone.png: is not there").wait_for()
    page.select_option("#image", "b")
    page.locator("#place", has_text=f"{WIDTH} ×").wait_for()
    page.fill("#name", "<b>new</b>")
    page.keyboard.press("Enter")
    page.locator("#chosen", has_text="Point <b>new</b>").wait_for()
    _clicked(page, 50.0, 60.0, 8.0)
    assert [row.image for row in server.session.folder.points.of_name("<b>new</b>")] == ["b"]


@pytest.mark.parametrize("width", [360, 1400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_cut_off(browser: Any, server: MeasuringServer, width: int, scheme: str) -> None:
    page, complaints = _opened(browser, server, viewport={"width": width, "height": 800}, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("#canvas").bounding_box()["height"] > 300
    assert complaints == []
