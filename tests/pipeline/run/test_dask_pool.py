"""Stages on a Dask cluster: the same bits, workers that die, and clusters that cannot do it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aatri.api import open_run, run_pipeline
from aatri.cli.main import app
from aatri.errors import AatriError
from aatri.pipeline.run import dask_pool

distributed: Any = pytest.importorskip("distributed", reason="Dask is not installed")
Client, LocalCluster = distributed.Client, distributed.LocalCluster

PIPELINE = """
run: here
seed: 1
stages:
  block:    {use: block/simulate, with: {preset: uav, flight: {strips: 2, images_per_strip: 4}, known: {full: 4}}}
  interior: {use: interior_orientation/calibrated, from: {block}}
  start:    {use: initial_orientation/graph, from: {block, image_points: interior}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: interior, initial: start}}
"""
MORTAL = """
import os
from pathlib import Path

from aatri.artifacts.block import Block
from aatri.artifacts.builder import block_of
from aatri.plugin import stage


@stage(version=1, uses=())
def mortal() -> Block:
    marker = Path({marker!r})
    if not marker.exists():
        marker.touch()
        os._exit(1)
    return block_of(name="after all")
"""


def _run(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["run", "--quiet", *arguments])
    assert done.exit_code == 0, done.output
    return done.output


def _digests(run: str) -> dict[str, Any]:
    return {name: stage.record["output"]["content_digest"] for name, stage in open_run(run).items()}


@pytest.mark.slow
def test_a_cluster_gives_the_bits_of_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("pipeline.yaml").write_text(PIPELINE)
    _run()
    local = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    with local as cluster, Client(cluster) as client:
        run_pipeline("pipeline.yaml", into="there", cluster=client)
    assert _digests("here") == _digests("there")


@pytest.mark.slow
def test_the_stage_of_a_worker_that_dies_is_made_by_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "stages" / "block"
    folder.mkdir(parents=True)
    (folder / "mortal.py").write_text(MORTAL.format(marker=str(tmp_path / "marker")))
    Path("pipeline.yaml").write_text("run: here\nseed: 1\nstages:\n  block: {use: block/mortal}\n")
    _run("--cluster", "local:2", "--local-plugins")
    assert (tmp_path / "marker").exists()
    assert list(open_run("here")) == ["block"]


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("local:x", "x is no number of workers"),
        ("here", "is no address"),
        ("local:", "nothing is no"),
        ("local:2:much", "much is no size of memory"),
        ("local::6GB", "nothing is no number"),
        ("local:2:", "nothing is no size of memory"),
        ("local:2:0GB", "0GB is no size of memory"),
        ("local:2:0.0000001MB", "0.0000001MB is no size of memory"),
    ],
)
def test_what_is_no_address_is_refused(tmp_path: Path, address: str, says: str) -> None:
    with pytest.raises(AatriError, match=says), dask_pool.dask_pool(address, tmp_path, lambda *_: None):
        pass


@pytest.mark.parametrize(
    ("address", "limit"), [("local:2:6GB", 6_000_000_000), ("local:1:0.5MB", 500_000), ("local:2", "auto")]
)
def test_local_workers_have_the_limit_of_memory_that_is_stated(
    monkeypatch: pytest.MonkeyPatch, address: str, limit: int | str
) -> None:
    monkeypatch.setattr("distributed.LocalCluster", lambda **settings: settings)
    assert dask_pool._local_cluster(address)["memory_limit"] == limit


def test_local_workers_that_do_not_start_are_told_as_such(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def failing(**_: Any) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("distributed.LocalCluster", failing)
    with (
        pytest.raises(AatriError, match=r"local workers do not start: Nanny failed"),
        dask_pool.dask_pool("local:2", tmp_path, lambda *_: None),
    ):
        pass


def test_a_worker_with_other_versions_or_without_the_folder_is_refused(tmp_path: Path) -> None:
    class Client:
        def __init__(self, answer: Any) -> None:
            self.answer = answer

        def run(self, _function: Any, path: str) -> dict[str, Any]:
            return {"tcp://a:1": self.answer(path)}

    own = dask_pool._versions()
    with pytest.raises(AatriError, match="tcp://a:1 does not see"):
        dask_pool._check(Client(lambda _: ("", own)), tmp_path)
    with pytest.raises(AatriError, match=r"tcp://a:1 has numpy 1\.0 instead of"):
        dask_pool._check(Client(lambda path: (Path(path).read_text(), {**own, "numpy": "1.0"})), tmp_path)
    dask_pool._check(Client(lambda path: (Path(path).read_text(), own)), tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_code_that_is_compared_has_the_stages_in_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert (dask_pool.BUILT_IN["aatri.stages"] / "block" / "simulate.py").exists()
    monkeypatch.setattr(dask_pool, "BUILT_IN", {"aatri": tmp_path / "a", "aatri.stages": tmp_path / "stages"})
    (tmp_path / "a").mkdir()
    (tmp_path / "stages").mkdir()
    before = dask_pool._versions()["code"]
    (tmp_path / "stages" / "new.py").write_text("")
    assert dask_pool._versions()["code"] != before
