"""The report page: complete, escaped, the same for the same folder, also of failed runs."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Rejects
from aatri.artifacts.suspects import Suspects
from aatri.errors import ArtifactError
from aatri.evaluation.accuracy import evaluate
from aatri.pipeline.store import run_folder as store
from aatri.report.page import write_report
from aatri.report.verdict import internal_lights
from aatri.report.view.run_view import view
from aatri.tables import hdf5
from aatri.tables.digest import content_digest
from tests.made_solutions import made_block, made_solution
from tests.pipeline.made_runs import bare_record, commit

STAGES = [
    ("block", "block/tables", {}, "Block"),
    ("bundle", "bundle_adjustment/bundle", {"block": "block"}, "Solution"),
    ("accuracy", "accuracy/evaluation", {"block": "block", "solution": "bundle"}, "Evaluation"),
]
TEXT = (
    "h1 h2 h3 p div ul nav ol li span b i dl dt dd small code a details summary pre table caption thead tbody tr th td"
)
FRAME = "html head meta title style body header main section figure figcaption svg g path text script"
ELEMENTS = {*TEXT.split(), *FRAME.split()}
PAYLOADS = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</title></svg><svg onload=alert(1)>",
    "{{ 7*7 }}{% raw %}",
    "</style><style>*{}",
    "javascript:alert(1)",
    "<!--",
    "]]><iframe src=//x>",
]


class Elements(HTMLParser):
    """Collects elements, attributes and text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.attributes: set[tuple[str, str]] = set()
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs) -> None:
        self.names.add(tag)
        self.attributes |= {(name, value or "") for name, value in attrs}

    def handle_comment(self, data) -> None:
        raise AssertionError(f"a comment: {data}")

    def handle_data(self, data) -> None:
        self.text += data


def make_run(folder: Path, artifacts, *, status="done", declared=STAGES, **record):
    stages = [{"stage": s, "use": u, "from": f, "kind": k} for s, u, f, k in declared]
    overview = {"pipeline": "p/pipeline.yaml", "seed": 1, "started": "2026-01-01T00:00:00+00:00", "stages": stages}
    store.begin(folder, overview | {"status": status})
    for name, artifact in artifacts.items():
        full = (
            bare_record()
            | {"options": {"a": 1.5}, "seed": 1, "metrics": artifact.metrics(), "environment": {"numpy": "2.0"}}
            | record
        )
        commit(folder, name, "0123456789ab", artifact, full)
    return folder


def made_artifacts(block=None, **changes):
    block = made_block() if block is None else block
    solution = made_solution(block, shift_m=np.random.default_rng(3).normal(0, 0.02, (len(block.points), 3)), **changes)
    return {"block": block, "bundle": solution, "accuracy": evaluate(block, solution)}


def test_a_complete_run_has_a_verdict_counts_accuracy_and_pictures(tmp_path: Path) -> None:
    page = write_report(make_run(tmp_path / "run", made_artifacts()))
    text = page.read_text(encoding="utf-8")
    found = Elements(text)
    assert page == tmp_path / "run" / "report.html"
    assert "complete, 3 stages" in found.text
    assert "RMSE" in found.text
    assert "fewer than 30" in found.text
    for picture in (
        "Block plan",
        "Differences in plan",
        "Differences in height",
        "sigma0 of the stages",
        "Rays per point",
        "Ties between images",
    ):
        assert picture in found.text
    assert found.names <= ELEMENTS


def test_the_page_loads_nothing_and_runs_its_one_script_alone(tmp_path: Path) -> None:
    text = write_report(make_run(tmp_path / "run", made_artifacts())).read_text(encoding="utf-8")
    (script,) = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'"
    assert policy in text
    assert text.count("<script") == 1
    assert "http" not in text.replace("http-equiv", "")
    assert "url(" not in text


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("payload", ["".join(PAYLOADS), PAYLOADS[0]])
def test_text_from_the_data_is_never_markup(tmp_path: Path, payload) -> None:
    block = made_block(
        rejects=Rejects(kind=["image"], id=[payload], reason=[payload], file=[-1], line=[0]), name=payload
    )
    names = block.points.id.astype("U255")
    names[[0, 4]] = [payload, payload + "b"]
    block = dataclasses.replace(
        block,
        points=dataclasses.replace(block.points, id=names),
        strips=dataclasses.replace(block.strips, id=[payload, "2"]),
    )
    suspects = Suspects(
        kind=[payload],
        row=[0],
        image=[payload],
        point=[payload],
        stage=[payload],
        size=[1.0],
        unit=[payload],
        sigma=[0.1],
        test=[9.0],
        verdict=[payload],
    )
    plain = made_block()
    solution = made_solution(plain, shift_m=0.01, suspects=suspects)
    solution = dataclasses.replace(solution, points=dataclasses.replace(solution.points, id=names))
    artifacts = {"block": block, "bundle": solution, "accuracy": evaluate(block, solution)}
    run = make_run(tmp_path / "run", artifacts, warnings=[payload], options={payload: payload, "list": [payload]})
    store.fail(run, "accuracy", {"what": payload, "where": payload, "remedy": payload, "options": {payload: payload}})
    found = Elements(write_report(run).read_text(encoding="utf-8"))
    assert found.names <= ELEMENTS
    assert payload in found.text
    assert "49" not in [word for word in found.text.split() if word.strip("{}") == "49"]
    assert {name for name, _ in found.attributes if name.startswith("on")} == set()
    assert all(value.startswith("#") for name, value in found.attributes if name == "href")
    assert not {"src", "style"} & {name for name, _ in found.attributes}


@pytest.mark.slow
def test_the_same_folder_gives_the_same_page(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", made_artifacts())
    assert write_report(run).read_bytes() == write_report(run).read_bytes()


def test_what_this_process_has_made_is_not_read_again_and_gives_the_same_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    artifacts = made_artifacts()
    run = make_run(tmp_path / "run", artifacts)
    page = write_report(run).read_bytes()
    monkeypatch.delattr(hdf5, "read")
    assert write_report(run, in_memory={content_digest(one): one for one in artifacts.values()}).read_bytes() == page


def test_a_failed_run_says_which_stage_failed_why_and_what_to_do(tmp_path: Path) -> None:
    artifacts = made_artifacts()
    run = make_run(tmp_path / "run", {"block": artifacts["block"]}, status="failed")
    error = {
        "what": "control is collinear",
        "where": "bundle",
        "remedy": "add a control point",
        "options": {"b": 2},
        "exit_code": 4,
        "ended": "2026-01-01T00:00:01+00:00",
    }
    (run / "running" / "bundle.log").write_text("    0.001  the last words\n")
    store.fail(run, "bundle", error)
    found = Elements(write_report(run).read_text(encoding="utf-8"))
    for words in (
        "Stage bundle",
        "control is collinear",
        "add a control point",
        "the last words",
        "not run",
        "bundle failed; 1 of 3 stages done",
        "no solution",
    ):
        assert words in found.text
    assert "complete, 3" not in found.text


def test_a_run_that_made_nothing_still_has_a_page(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {}, status="interrupted")
    assert "not complete: 0 of 3 stages done" in write_report(run).read_text(encoding="utf-8")


@pytest.mark.parametrize("in_memory", [False, True])
def test_an_altered_artifact_is_named_and_not_shown(tmp_path: Path, in_memory: bool) -> None:
    artifacts = made_artifacts()
    run = make_run(tmp_path / "run", artifacts)
    path = store.artifact_path(run, "bundle")
    path.write_bytes(path.read_bytes()[:-1])
    made = {content_digest(one): one for one in artifacts.values()} if in_memory else {}
    text = write_report(run, in_memory=made).read_text(encoding="utf-8")
    assert "The artifact cannot be shown" in text
    assert "altered since it was written" in text


def test_a_folder_without_a_run_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="not the folder of a run"):
        write_report(tmp_path)


def test_without_check_points_there_is_no_check_figure_on_the_page(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", made_artifacts(made_block(check=False)))
    text = write_report(run).read_text(encoding="utf-8")
    assert "<b>Independent check</b> no check points" in text
    assert "No independent check" in text


@pytest.mark.slow
def test_a_large_block_is_thinned_and_the_page_says_so(tmp_path: Path) -> None:
    block = made_block(columns=1000, rows=10, rays=False)
    page = write_report(make_run(tmp_path / "run", made_artifacts(block)))
    assert page.stat().st_size < 5e6
    text = page.read_text(encoding="utf-8")
    assert "400 of 2000 footprints" in text


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("rejected", "1 image point rejected; listed"),
        ("readmitted", "none rejected, 1 kept"),
    ],
)
def test_only_rejected_suspects_turn_the_light(tmp_path: Path, verdict: str, words: str) -> None:
    suspects = Suspects(
        kind=["image_point"],
        row=[0],
        image=["1-0"],
        point=["p00"],
        stage=["bundle_adjustment"],
        size=[0.03],
        unit=["mm"],
        sigma=[0.006],
        test=[5.0],
        verdict=[verdict],
    )
    text = Elements(write_report(make_run(tmp_path / "run", made_artifacts(suspects=suspects))).read_text("utf-8")).text
    assert f"bundle: {words}" in text


def test_ties_that_earlier_stages_rejected_are_no_suspects_of_the_bundle(tmp_path: Path) -> None:
    n = 100
    kind = ["strip_tie"] * (n - 2) + ["model_tie", "control"]
    stage = ["strip_formation"] * (n - 1) + ["bundle_adjustment"]
    suspects = Suspects(
        kind=kind,
        row=[-1] * n,
        image=["s"] * n,
        point=["p00"] * n,
        stage=stage,
        size=[1.0] * n,
        unit=["m"] * n,
        sigma=[0.1] * n,
        test=[10.0] * n,
        verdict=["rejected"] * n,
    )
    run = make_run(tmp_path / "run", made_artifacts(suspects=suspects))
    text = Elements(write_report(run).read_text("utf-8")).text
    assert "bundle: 1 control point rejected" in text
    assert "in stages before it 98 strip ties, 1 model point" in text
    lights = internal_lights(view(run), made_solution(made_block(), suspects=suspects))
    assert next(one for one in lights if one.title == "Suspects").state == "look"


@pytest.mark.slow
def test_a_page_says_of_which_block_of_several_it_is(tmp_path: Path) -> None:
    artifacts = made_artifacts()
    assert "Blocks of this run" not in write_report(make_run(tmp_path / "one", artifacts)).read_text("utf-8")
    stages = [("first", "block/tables", {}, "Block"), *STAGES]
    run = make_run(tmp_path / "two", {"first": made_block(columns=4)} | artifacts, declared=stages)
    text = Elements(write_report(run).read_text("utf-8")).text
    assert "Blocks of this run: first, block. This page is about block." in text
