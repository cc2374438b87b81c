"""The page in a browser: nothing is loaded or complained of; the pointer tells, a click isolates, tables are sorted.

Needs playwright and a Chromium on the machine; `pip install 'aatri[browser]'`.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import ParameterCovariances, Parameters
from aatri.artifacts.suspects import Suspects
from aatri.evaluation.accuracy import evaluate
from aatri.pipeline.store import run_folder as store
from aatri.report.page import write_report
from aatri.report.printing import write_pdf
from tests.made_solutions import made_block
from tests.report.test_page import STAGES, made_artifacts, make_run
from tests.report.test_pictures import in_pixels
from tests.report.test_vectors import adjusted_network

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")]

BROKEN_OR_CUT = """width => {
    const broken = [...document.querySelectorAll("td")].filter(td => td.offsetParent && td.childNodes.length === 1)
        .filter(({ firstChild: text }) => text.nodeType === Node.TEXT_NODE && /^\\S{1,16}$/.test(text.data))
        .filter(({ firstChild: text }) => {
            const range = document.createRange();
            range.selectNode(text);
            return range.getClientRects().length > 1;
        });
    const wide = [...document.querySelectorAll("table")].filter(t => t.getBoundingClientRect().right > width + 1);
    return [...broken, ...(matchMedia("print").matches ? wide : [])].map(e => e.textContent);
}"""
"""Ids in cells that stand on two lines; on paper tables that go over its edge, too."""


@pytest.fixture(scope="module")
def browser() -> Iterator[sync_api.Browser]:
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield running
        running.close()


def _complete(folder: Path) -> Path:
    return make_run(folder, made_artifacts(made_block(columns=12)))


def _long_names(folder: Path) -> Path:
    block = made_block(columns=9)
    ids = np.array([f"DJI_20260101120000_{k:04d}_D" for k in range(len(block.images))])
    block = replace(block, images=replace(block.images, id=ids))
    stages = [("block_of_the_northern_valley", "block/tables", {}, "Block"), *STAGES[1:]]
    stages[1] = ("bundle", "bundle_adjustment/" + "bundle_with_parameters" * 2, {"block": stages[0][0]}, "Solution")
    artifacts = made_artifacts(block, suspects=_suspect("valley-north-01"))
    return make_run(folder, {stages[0][0]: artifacts.pop("block"), **artifacts}, declared=stages)


def _failed(folder: Path) -> Path:
    run = make_run(folder, {"block": made_block()}, status="failed")
    store.fail(run, "bundle", {"what": "control is collinear", "remedy": "add a control point", "options": {}})
    return run


def _wrong_control(folder: Path) -> Path:
    return make_run(folder, made_artifacts(suspects=_suspect("p00")))


def _suspect(point: str) -> Suspects:
    return Suspects(
        kind=["control"],
        row=[0],
        image=[""],
        point=[point],
        stage=["bundle_adjustment"],
        size=[1.0],
        unit=["m"],
        sigma=[0.1],
        test=[9.0],
        verdict=["rejected"],
    )


def _calibrated(folder: Path) -> Path:
    parameters = Parameters(
        group=["additional"] * 2, object=["cam"] * 2, name=["k1", "p1"], value=[1.0, 1.0], sigma=[2.0, 3.0]
    )
    covariances = ParameterCovariances(first=[0, 0, 1], second=[0, 1, 1], covariance=[4.0, -4.5, 9.0])
    return make_run(folder, made_artifacts(parameters=parameters, parameter_covariances=covariances))


def _photographed(folder: Path) -> Path:
    file = folder.parent / "photograph.png"
    pytest.importorskip("PIL.Image").new("L", (230, 230), 90).save(file)
    block = made_block(columns=9, rows=8)
    return make_run(folder, made_artifacts(in_pixels(block, path=np.array([str(file)] * len(block.images)))))


def _network(folder: Path) -> Path:
    block, solution = adjusted_network(folder.parent)
    return make_run(folder, {"block": block, "bundle": solution, "accuracy": evaluate(block, solution)})


def _large(folder: Path) -> Path:
    return make_run(folder, made_artifacts(made_block(columns=800, rows=10, rays=False)))


@pytest.mark.parametrize(
    "made",
    [
        _complete,
        _long_names,
        _failed,
        _wrong_control,
        _calibrated,
        _photographed,
        _network,
        _large,
        lambda folder: make_run(folder, {}, status="interrupted"),
    ],
    ids=[
        "complete",
        "long names",
        "failed",
        "gross error",
        "calibration",
        "photographs",
        "network",
        "large",
        "nothing",
    ],
)
def test_no_error_no_request_and_nothing_wider_than_the_screen(made, browser: sync_api.Browser, tmp_path: Path) -> None:
    address = write_report(made(tmp_path / "run")).as_uri()
    for width, scheme, media in ((360, "light", "screen"), (1400, "dark", "screen"), (700, "light", "print")):
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        said, asked = [], []
        page.on("console", lambda message, said=said: said.append(message.text))
        page.on("pageerror", lambda error, said=said: said.append(str(error)))
        page.on("request", lambda request, asked=asked: asked.append(request.url))
        page.emulate_media(media=media)
        page.goto(address)
        page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        page.wait_for_timeout(50)
        assert said == []
        assert asked == [address]
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(BROKEN_OR_CUT, width) == []
        page.close()


@pytest.fixture
def page(browser: sync_api.Browser, tmp_path: Path) -> Iterator[sync_api.Page]:
    opened = browser.new_page(viewport={"width": 1400, "height": 1000})
    opened.goto(write_report(_complete(tmp_path / "run")).as_uri())
    yield opened
    opened.close()


def _at(page: sync_api.Page, colour: str) -> tuple[float, float]:
    """Where on the screen the first mark of a colour of the plan lies."""
    return tuple(
        page.evaluate(
            """colour => {
        const svg = document.querySelector("#plan svg.plan");
        svg.scrollIntoView({ block: "center" });
        const [x, y] = svg.querySelector(`.marks .dots.${colour}`).getAttribute("d").slice(1).split("h")[0].split(" ");
        const r = svg.getBoundingClientRect(), k = r.width / svg.viewBox.baseVal.width;
        return [r.left + x * k, r.top + y * k];
    }""",
            colour,
        )
    )


def test_the_pointer_tells_what_it_is_at_and_a_click_isolates_the_rays_of_an_image(page: sync_api.Page) -> None:
    page.mouse.move(*_at(page, "blue"))
    assert "1-0" in page.locator("#plan .tip").inner_text()
    page.mouse.down()
    page.mouse.up()
    d = page.locator("#plan .rays").get_attribute("d")
    assert d is not None
    assert d.count("M") == 48  # every point of 12 by 4 is seen from every image
    others = page.locator("#ties svg[data-at] .rays")
    assert others.count() == page.locator("#ties svg[data-at]").count() > 0
    assert (others.first.get_attribute("d") or "").count("M") == 48
    page.get_by_role("button", name="all").first.click()
    assert page.locator(".rays").count() == 0


def test_what_a_click_does_is_told_on_the_screen_and_not_on_paper(page: sync_api.Page) -> None:
    words = page.get_by_text("A click on an image or a point")
    assert words.is_visible()
    page.emulate_media(media="print")
    assert not words.is_visible()


def test_a_click_in_another_picture_isolates_too(page: sync_api.Page) -> None:
    page.evaluate("document.querySelector('[data-name=rays] svg').scrollIntoView({ block: 'center' })")
    place = page.evaluate("""() => {
        const svg = document.querySelector("[data-name=rays] svg"), path = svg.querySelector("path[data-ids]");
        const [x, y] = path.getAttribute("d").slice(1).split("h")[0].split(" ");
        const r = svg.getBoundingClientRect(), k = r.width / svg.viewBox.baseVal.width;
        return [r.left + x * k, r.top + y * k];
    }""")
    page.mouse.click(*place)
    d = page.locator("#plan .rays").get_attribute("d") or ""
    assert d.count("M") == 24  # every point is seen from all 24 images


def test_a_plan_is_enlarged_with_the_length_of_its_bar(page: sync_api.Page) -> None:
    plan = page.locator("#plan")
    before = plan.locator(".scale").text_content()
    plan.get_by_role("button", name="+").click()
    assert "scale(2)" in (plan.locator("g.marks").get_attribute("transform") or "")
    assert float(plan.locator(".scale").text_content().split()[0]) == float(before.split()[0]) / 2


def test_the_bar_of_an_enlarged_plan_has_the_unit_of_its_length(browser: sync_api.Browser, tmp_path: Path) -> None:
    opened = browser.new_page(viewport={"width": 1400, "height": 1000})
    opened.goto(write_report(_complete(tmp_path / "run")).as_uri())
    bar, larger = opened.locator("#plan .scale"), opened.locator("#plan").get_by_role("button", name="+")
    opened.evaluate("document.querySelector('#plan .scale').textContent = '1 km'")
    for length in ("500 m", "250 m"):
        larger.click()
        assert bar.text_content() == length
    opened.close()


def test_tables_are_sorted_by_a_click_and_searched(page: sync_api.Page) -> None:
    table = page.locator("#certainty table", has_text="omega")
    page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    first = "td >> nth=0"
    assert table.locator("tbody tr").first.locator(first).inner_text() == "1-0"
    table.locator("th").nth(1).click()
    table.locator("th").nth(1).click()
    values = [float(text) for text in table.locator("tbody tr td:nth-child(2)").all_inner_texts()]
    assert values == sorted(values, reverse=True)
    table.locator("xpath=..").locator("input").fill("2-11")
    assert table.locator("tbody tr:visible").count() == 1


def test_the_report_is_printed_and_the_summary_has_two_pages(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", made_artifacts(made_block(columns=12)))
    for short, pages in ((False, range(4, 11)), (True, (1, 2))):
        data = write_pdf(run, summary=short).read_bytes()
        assert data.startswith(b"%PDF")
        assert data.count(b"/Type /Page\n") in pages


def test_without_a_browser_the_error_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from aatri.errors import ResourceError

    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ResourceError, match="no Chromium, Chrome or Edge") as raised:
        write_pdf(make_run(tmp_path / "run", {}))
    assert "print it" in raised.value.remedy


def test_labels_of_a_large_plan_stand_above_its_marks(browser: sync_api.Browser, tmp_path: Path) -> None:
    opened = browser.new_page(viewport={"width": 1400, "height": 1000})
    opened.goto(write_report(_large(tmp_path / "run")).as_uri())
    opened.locator("#plan svg.many").scroll_into_view_if_needed()
    opened.wait_for_selector("#plan canvas", state="attached")
    above = "svg => +getComputedStyle(svg).zIndex > (+getComputedStyle(svg.nextElementSibling).zIndex || 0)"
    assert opened.locator("#plan svg.many").evaluate(above)
    opened.close()
