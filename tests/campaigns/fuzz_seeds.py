"""Small good inputs of every reader, for the fuzz campaign, and how each is read."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.pipeline.methods.catalogue import Catalogue
from aatri.pipeline.plan.graph import wire
from aatri.pipeline.spec.pipeline_file import load_spec
from aatri.pipeline.store.records import SCHEMA, read_failure, read_overview, read_record, seal
from aatri.stages.interior_orientation.affine import affine
from aatri.tables import hdf5
from aatri.tables.schema import Artifact
from tests.campaigns.hdf5_changes import changed_file
from tests.contract.made_files import colmap_model
from tests.formats.start_solution import start_solution, write_binary
from tests.formats.tables.block_folder import write_folder
from tests.reading import read_bal, read_block, read_colmap, read_dbat, read_gama, read_pairs, read_wucaps
from tests.stages.film_blocks import flown


@dataclass(frozen=True)
class Reader:
    """A reader: `write` puts a good input into a folder, `read` reads it; `files` are those that are changed."""

    write: Callable[[Path], object]
    read: Callable[[Path], object]
    files: tuple[str, ...]
    binary: bool = False
    other: Callable[[bytes, random.Random], bytes] | None = None
    """Changes the file in its own way, half of the times."""


BAL = (
    "3 4 12\n"
    + "".join(
        f"{c} {p} {100 * (p % 2) + 3 * c - 50}.5 {80 * (p // 2) - 2 * c - 40}.25\n" for c in range(3) for p in range(4)
    )
    + "".join(f"0.0{c}\n0.1\n-0.02\n{c}\n0\n-10\n900\n1e-7\n-1e-12\n" for c in range(3))
    + "".join(f"{p % 2}.5\n{p // 2}\n-0.{p}\n" for p in range(4))
)
WUCAPS = {
    "PRECAI.DAT": "1 4\n153.84 0.011 0.002\n0 0 0\n1 106.002 -106.003\n2 -106.001 -106.004\n3 -106 106.002\n"
    "4 105.999 106.002\n-99.0 0\n",
    "PRECKI.DAT": "8031901 4505079.577 446263.976 6.378\n831000 4505078.925 446018.619 7.841\n"
    "832000 4504373.096 445861.999 6.449\n833000 4504731.275 445838.591 7.337\n-99 0 0 0\n",
    "PRECPI.DAT": "2 1 0\n8031901\n831000\n832000\n833000\n",
    "PREPHI.DAT": "1 10 25000 0\n321 0\n11 8.8199 76.0231\n12 76.7010 72.7165\n21 1.8117 -21.0871\n831000 78.12 70.84\n"
    "-99 0 0\n-320 0\n11 -73.5371 76.1849\n12 -5.1185 74.0827\n21 -79.1070 -21.7547\n831000 6.1 70.9\n"
    "-99 0 0\n",
}
_CAMERA = "7.4653 3.6173 2.6128 7.25319 5.43764 0.00498 -0.0001 0 -0.00006 -0.00004"
_SIGMAS = "0 0.00725 0.00544 0.5 0.5 0.001 0.0001 0.0001 0.001 0.001"
DBAT = (
    f"a project\n 0.0005 20 2272 1704\n 1 0.1 10 100 100 100 20 20 20\n {_CAMERA}\n {_SIGMAS}\n"
    + "".join(
        f" {k} images\\P{k}.JPG\n {k} 0.{k} 1.794 1.468 -179.8 -1.18 -39.4\n {k} 0 0 0 0 0 0\n\n"
        f" {k} 7.465 3.617 2.613 7.25319 5.43764 0.00498 -0.0001 0 -0.00006 -0.00004\n {k} {_SIGMAS}\n"
        for k in range(3)
    )
    + "\n1001 0 1 0 0 0 0\n1002 1 1 0 0 0 0\n1003 0 0 0.1 0 0 0\n"
    + "\n1001 0 1 0 0 0 0\n1002 1 1 0 0 0 0\n1003 0 0 0.1 0 0 0\n7 0.5 0.5 0 0 0 0\n8 0.2 0.7 0 0 0 0\n\n"
    + "".join(
        f"{k} {p} {300 + 200 * j}.5 {400 + 31 * k * j} 0.1 0.1\n"
        for k, seen in enumerate(((1001, 1002, 7, 8), (1002, 1003, 7, 8), (1001, 7, 8)))
        for j, p in enumerate(seen)
    )  # so few angles between control that nothing is held against them
)
CONTROL = (
    "# id, name, X, Y, Z, sX, sY, sZ\n1001, a, 0, 1, 0\n1002, b, 1, 1, 0, 0.01\n1003, c, 0, 0, 0.1, 0.01, 0.01, 0.02\n"
)
_GRID = [(k, 20 * (k // 3 + 1), 30 * (k % 3 - 1)) for k in range(9)]
PAIRS = {
    "1-2.dat": "153.84 0.011 0.002\n" + "".join(f"{k} {x + 0.5} {y} {x - 70.25} {y + 1.5}\n" for k, x, y in _GRID),
    "2-3.dat": "153.84 0.011 0.002\n"
    + "".join(f"{k} {x - 70.25} {y + 1.5} {x - 140.5} {y - 0.5}\n" for k, x, y in _GRID),
    "control.txt": "0 1000.5 2000.25 30.125\n2, 1010.5, 2040.25, 31.5\n",
    "check.txt": "# check\n4 1020.5 2020.25 33.5\n",
}
GAMA = """\
<?xml version="1.0" encoding="utf-8"?>
<gama-local xmlns="http://www.gnu.org/software/gama/gama-local">
<network axes-xy="ne" angles="left-handed">
<description>a network</description>
<parameters sigma-apr="1" />
<points-observations distance-stdev="3 2 0.5" direction-stdev="10">
<point id="A" x="1000.5" y="5000.25" z="10.5" fix="xyz" />
<point id="B" x="1100.25" y="5000.5" fix="xy" z="11" adj="z" />
<point id="P" adj="xyz" />
<obs from="A">
<direction to="B" val="0" />
<direction to="P" val="45-00-59.5" stdev="2" />
<distance to="P" val="100.125" />
<z-angle to="P" val="99.5" stdev="10" from_dh="1.5" />
</obs>
<obs from="B">
<s-distance to="P" val="80.5" stdev="5" />
<angle bs="A" fs="P" val="350.5" stdev="10" />
<cov-mat dim="2" band="1">25.5 10.5 100.5</cov-mat>
</obs>
<height-differences>
<dh from="A" to="P" val="1.25" stdev="2.5" />
</height-differences>
<vectors>
<vec from="A" to="P" dx="70.5" dy="70.25" dz="1.5" />
<cov-mat dim="3" band="2">9.5 1.5 1.25 9.5 1.5 9.5</cov-mat>
</vectors>
<coordinates>
<point id="Q" x="1200.5" y="5100.5" />
<cov-mat dim="2" band="1">4.5 1.5 4.5</cov-mat>
</coordinates>
</points-observations>
</network>
</gama-local>
"""
PIPELINE = """\
run: runs/fuzz
seed: 3
stages:
  block:    {use: block/simulate, with: {preset: rc30, flight: {strips: 2, images_per_strip: 5}}}
  interior: {use: interior_orientation/affine, from: {block}}
  refined:  {use: image_refinement/systematic, from: {block, image_points: interior}, with: {refraction: false}}
  models:
    use: relative_orientation/dependent
    from: {block, image_points: refined}
variants:
  plain: {refined: {with: {earth_curvature: false}}}
"""


def _write(files: dict[str, str]) -> Callable[[Path], object]:
    return lambda folder: [(folder / name).write_text(text) for name, text in files.items()]


def _colmap_binary(folder: Path) -> None:
    block = read_colmap(colmap_model(folder / "text"))
    write_binary(OrientedBlock(block, start_solution(block)), folder)


def _artifact(folder: Path) -> None:
    hdf5.write(read_block(write_folder(folder / "block")), folder / "a.h5", ["a warning"])


def _small_artifact(folder: Path) -> None:
    hdf5.write(affine(flown()), folder / "a.h5", ["a warning"])


def _every_way(path: Path, kind: type[Artifact]) -> None:
    hdf5.read_header(path)
    hdf5.read_warnings(path)
    hdf5.read_plain(path)
    hdf5.read(path, kind)


def _records(folder: Path) -> None:
    time, digest = "2026-01-01T00:00:00+00:00", "ab" * 32
    record = {
        "schema": SCHEMA,
        "stage": "s",
        "key": "0123456789ab",
        "plugin": "a/b",
        "version": 1,
        "options": {"x": [1.5]},
        "inputs": {"a": {"stage": "a", "key": "k", "content_digest": digest}},
        "seed": None,
        "parts": {
            "plugin": "a/b",
            "version": 1,
            "options": {},
            "files": {},
            "inputs": {},
            "code": "",
            "schemas": {},
            "seed": None,
        },
        "metrics": {"sigma0": 1.0, "none": None},
        "warnings": ["w \u70b9"],
        "started": time,
        "ended": time,
        "seconds": 0.5,
        "environment": {"numpy": "2"},
        "output": {"kind": "K", "file": "artifact.h5", "sha256": digest, "size": 1, "content_digest": digest},
    }
    folder.joinpath("current").mkdir()
    folder.joinpath("failed", "s").mkdir(parents=True)
    (folder / "current" / "s.json").write_text(json.dumps(record | {"seal": seal(record)}))
    stages = [{"stage": "s", "use": "a/b", "from": {"a": "a"}, "kind": "K"}]
    (folder / "run.json").write_text(json.dumps({"stages": stages, "status": "done", "pipeline": "p", "request": {}}))
    failure = {"what": "w", "where": "", "remedy": "", "exit_code": 4, "ended": time, "key": "k"}
    (folder / "failed" / "s" / "error.json").write_text(json.dumps(failure))


def _read_records(folder: Path) -> None:
    for read in (lambda: read_record(folder, "current", "s.json"), lambda: read_overview(folder)):
        read()
    read_failure(folder, "s")


_CATALOGUE: list[Catalogue] = []


def _read_pipeline(folder: Path) -> None:
    from aatri.pipeline.spec.overrides import with_variant

    if not _CATALOGUE:
        _CATALOGUE.append(Catalogue())
    spec = load_spec(folder / "pipeline.yaml")
    wire(spec, _CATALOGUE[0])
    for name in spec.variants:
        wire(with_variant(spec, name), _CATALOGUE[0])


TABLES = (
    "images.csv",
    "image_points.csv",
    "fiducials.csv",
    "ground_points.csv",
    "exterior.csv",
    "geodetic.csv",
    "covariances.csv",
    "relative_control.yaml",
)
READERS: dict[str, Reader] = {
    "tables": Reader(write_folder, read_block, TABLES),
    "block": Reader(write_folder, read_block, ("block.yaml",)),
    "pipeline": Reader(_write({"pipeline.yaml": PIPELINE}), _read_pipeline, ("pipeline.yaml",)),
    "wucaps": Reader(_write(WUCAPS), read_wucaps, tuple(WUCAPS)),
    "dbat": Reader(
        _write({"export.txt": DBAT, "control.txt": CONTROL}),
        lambda f: read_dbat(f / "export.txt", f / "control.txt"),
        ("export.txt", "control.txt"),
    ),
    "gama": Reader(_write({"n.gkf": GAMA}), lambda f: read_gama(f / "n.gkf"), ("n.gkf",)),
    "pairs": Reader(
        _write(PAIRS),
        lambda f: read_pairs(
            f,
            unit_um=1000.0,
            image_sigma_um=10.0,
            control=f / "control.txt",
            check=f / "check.txt",
            control_sigma_m=0.02,
            max_reject_share=1.0,
        ),
        tuple(PAIRS),
    ),
    "bal": Reader(_write({"p.txt": BAL}), lambda f: read_bal(f / "p.txt"), ("p.txt",)),
    "colmap": Reader(
        lambda f: colmap_model(f / "m"),
        lambda f: read_colmap(f / "m"),
        ("m/cameras.txt", "m/images.txt", "m/points3D.txt"),
    ),
    "colmap_binary": Reader(_colmap_binary, read_colmap, ("cameras.bin", "images.bin", "points3D.bin"), binary=True),
    "control": Reader(
        lambda f: (
            colmap_model(f / "m"),
            (f / "g.csv").write_text("point,X,Y,Z,sX,sY,sZ\n1,0,0,5,1,1,1\n2,1,1,5,0,0,0\n"),
        ),
        lambda f: read_colmap(f / "m", control=f / "g.csv"),
        ("g.csv",),
    ),
    "records": Reader(_records, _read_records, ("run.json", "current/s.json", "failed/s/error.json")),
    "hdf5": Reader(
        _small_artifact, lambda f: _every_way(f / "a.h5", ImagePoints), ("a.h5",), binary=True, other=changed_file
    ),
    "hdf5_block": Reader(
        _artifact, lambda f: _every_way(f / "a.h5", Block), ("a.h5",), binary=True, other=changed_file
    ),
}

OF_BLOCKS = ("tables", "block", "wucaps", "dbat", "gama", "pairs", "bal", "colmap", "control")
"""Readers of texts that make a Block."""
