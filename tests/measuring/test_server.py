"""The server answers its own page only, and each bad case with one sentence."""

from __future__ import annotations

import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cv2", reason="works on images need the extra `images`")

from aatri.errors import InputError
from aatri.measuring.server import MeasuringServer
from aatri.measuring.session import Session
from tests.measuring.made_folder import CROSSES, made_folder


@pytest.fixture
def server(tmp_path: Path) -> Iterator[MeasuringServer]:
    running = MeasuringServer(Session(made_folder(tmp_path / "block")))
    thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield running
    running.shutdown()
    thread.join()
    running.server_close()


def _ask(server: MeasuringServer, path: str, body: Any = None, **headers: str) -> tuple[int, Any, dict[str, str]]:
    """Status, answer and headers of a request below the token."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    given = {"Content-Type": "application/json"} | {k.replace("_", "-"): v for k, v in headers.items()}
    text = None if body is None else json.dumps(body)
    where = path if path.startswith("//") else f"/{server.token}/{path}"
    connection.request("GET" if body is None else "POST", where, text, given)
    answer = connection.getresponse()
    raw = answer.read()
    connection.close()
    found = dict(answer.getheaders())
    return answer.status, json.loads(raw) if found["Content-Type"] == "application/json" else raw, found


CLICK = {"kind": "point", "image": "a", "name": "G1", "before": "", "x": 100.0, "y": 50.0}


def test_the_page_is_served_and_may_load_nothing_from_elsewhere(server: MeasuringServer) -> None:
    status, page, headers = _ask(server, "")
    assert status == 200
    assert b"http" not in page  # no address of any other place
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert server.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example:PORT"},
        {"Host": "127.0.0.1"},
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
def test_another_page_gets_nothing_and_changes_nothing(server: MeasuringServer, headers: dict[str, str]) -> None:
    headers = {k: v.replace("PORT", str(server.server_port)) for k, v in headers.items()}
    for path, body in (("state", None), ("measure", CLICK)):
        status, told, _ = _ask(server, path, body, **headers)
        assert (status, told["error"].partition(":")[0]) == (403, "not for you")
    assert not server.session.folder.points.path.exists()


@pytest.mark.parametrize("path", ["//127.0.0.1/", "//x/state", "//", "//%2e%2e/state"])
def test_without_the_token_there_is_nothing(server: MeasuringServer, path: str) -> None:
    assert _ask(server, path)[0] == 403


@pytest.mark.parametrize("path", ["../../etc/passwd", "%2e%2e%2f%2e%2e%2fblock.yaml", "block.yaml", "index.html"])
def test_no_file_beside_the_page_is_given_out(server: MeasuringServer, path: str) -> None:
    assert _ask(server, path)[0] == 404


def test_a_form_of_another_page_is_no_change(server: MeasuringServer) -> None:
    status, told, _ = _ask(server, "measure", CLICK, **{"Content_Type": "text/plain"})
    assert (status, "does not make" in told["error"]) == (400, True)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"image": "../a"}, "image '../a' is not in images.csv"),
        ({"image": "c"}, "gone.png: is not there"),
        ({"image": "d"}, "image 'd' has no path in images.csv"),
        ({"x": -3.0}, "(-3.0, 50.0) is outside of the image"),
        ({"x": float("nan")}, "(nan, 50.0) is outside of the image"),
        ({"name": " "}, "' ' is no id"),
        ({"kind": "fiducial", "name": "7"}, "the camera of image a has no fiducial '7'"),
        ({"before": "a,G1,1,2"}, "point G1 in image a was changed meanwhile"),
    ],
)
def test_a_click_that_cannot_be_is_refused_in_a_sentence(
    server: MeasuringServer, change: dict[str, Any], sentence: str
) -> None:
    status, told, _ = _ask(server, "measure", CLICK | change)
    assert status in (400, 409)
    assert sentence in told["error"]
    assert "\n" not in told["error"]
    assert not server.session.folder.points.path.exists()


def test_a_picture_that_is_gone_is_named_and_the_others_stay(server: MeasuringServer) -> None:
    assert "gone.png: is not there" in _ask(server, "image?image=c")[1]["error"]
    assert _ask(server, "image?image=a")[1]["width"] == 700
    status, tile, headers = _ask(server, "tile?image=a&level=0&column=2&row=1")
    assert (status, headers["Content-Type"], tile[:4]) == (200, "image/png", b"\x89PNG")
    assert "no tile" in _ask(server, "tile?image=a&level=0&column=9&row=1")[1]["error"]


def test_a_click_is_in_the_file_at_once_and_can_be_undone(server: MeasuringServer) -> None:
    told = _ask(server, "measure", CLICK)[1]
    path = server.session.folder.points.path
    assert path.read_text() == "image,point,x,y\na,G1,100.0000,50.0000\n"
    assert _ask(server, "state")[1]["points"][0] == {"name": "G1", "role": "control", "count": 1}
    assert _ask(server, "undo", {"change": told["change"]})[1]["row"] is None
    assert path.read_text() == "image,point,x,y\n"


def test_the_other_tab_hears_of_a_click(server: MeasuringServer) -> None:
    version = _ask(server, "state")[1]["version"]
    assert _ask(server, f"state?known={version}")[1] == {"version": version}
    _ask(server, "measure", CLICK)
    assert _ask(server, f"state?known={version}")[1]["points"][0]["count"] == 1


def test_what_an_editor_writes_is_taken_over_and_what_it_breaks_is_told(server: MeasuringServer) -> None:
    folder = server.session.folder.folder
    _ask(server, "measure", CLICK)
    version = _ask(server, "state")[1]["version"]
    with (folder / "ground_points.csv").open("a") as file:
        file.write("G3,20,0,0,check\n")
    (folder / "image_points.csv").write_text("image,point,x,y\na,G1,7,8\nb,G1,9,8\n")
    told = _ask(server, f"state?known={version}")[1]
    assert [(p["name"], p["count"]) for p in told["points"]] == [("G1", 2), ("G2", 0), ("G3", 0)]
    (folder / "ground_points.csv").write_text("point,X,Y,Z,role\nG1,0,zero,0,control\n")
    for _ in range(2):
        status, told, _headers = _ask(server, "state")
        assert (status, "zero" in told["error"]) == (400, True)


def test_a_folder_that_cannot_be_written_is_named(server: MeasuringServer, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, *args: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    told = _ask(server, "measure", CLICK)[1]
    assert "image_points.csv: cannot write: Permission denied" in told["error"]


@pytest.mark.parametrize(
    ("origin", "y", "expected"),
    [
        ("top-left-corner", "down", (100.0, 50.0)),
        ("top-left-centre", "down", (99.5, 49.5)),
        ("bottom-left-corner", "up", (100.0, 450.0)),
        ("image-centre", "up", (-250.0, 200.0)),
    ],
)
def test_coordinates_are_those_that_block_yaml_declares(
    tmp_path: Path, origin: str, y: str, expected: tuple[float, float]
) -> None:
    session = Session(made_folder(tmp_path, origin, y))
    told = session.measure(**CLICK)  # type: ignore[arg-type]
    assert session.folder.points.of_name("G1")[0].xy == pytest.approx(expected)
    assert (told["row"]["x"], told["row"]["y"]) == pytest.approx((100.0, 50.0))


@pytest.mark.parametrize("image", CROSSES)
def test_the_centre_of_a_cross_is_found(tmp_path: Path, image: str) -> None:
    x, y = CROSSES[image]
    found = Session(made_folder(tmp_path)).centre(image, x + 2.6, y - 1.9, 10)
    assert (found["x"], found["y"]) == pytest.approx((x, y), abs=0.05)


def test_where_nothing_has_a_centre_that_is_said(tmp_path: Path) -> None:
    session = Session(made_folder(tmp_path))
    with pytest.raises(InputError, match="no mark with a centre within 8 px"):
        session.centre("a", 3.0, 3.0, 8)


def test_a_block_without_paths_says_what_to_do(tmp_path: Path) -> None:
    folder = made_folder(tmp_path)
    (folder / "images.csv").write_text("image,camera\na,c\n")
    with pytest.raises(InputError, match="no image has a path") as told:
        Session(folder)
    assert "add a column path" in told.value.remedy


def test_a_picture_of_another_size_is_refused(tmp_path: Path) -> None:
    folder = made_folder(tmp_path)
    (folder / "block.yaml").write_text((folder / "block.yaml").read_text().replace("[700, 500]", "[6000, 4000]"))
    with pytest.raises(InputError, match=r"has 700 x 500 pixels, format in block\.yaml is 6000 x 4000"):
        Session(folder).image("a")
