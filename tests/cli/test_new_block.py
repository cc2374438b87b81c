"""Templates of a block folder are a block once images, points and control are filled in, whatever is left alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from aatri.errors import AatriError
from aatri.formats.tables.source import FILES
from tests.reading import read_block


def _made(tmp_path: Path) -> Path:
    result = CliRunner().invoke(app, ["new", str(tmp_path), "--block", "tables"])
    assert result.exit_code == 0, result.stderr
    return tmp_path / "block"


def test_every_file_of_the_contract_has_a_template(tmp_path: Path) -> None:
    assert {path.name for path in _made(tmp_path).iterdir()} == set(FILES)
    assert "block/tables" in (tmp_path / "pipeline.yaml").read_text()


def test_the_templates_say_what_to_fill_in(tmp_path: Path) -> None:
    with pytest.raises(AatriError, match=r"images.csv: no rows"):
        read_block(_made(tmp_path))


def test_the_commented_rows_of_the_templates_are_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aatri.checks.as_read.angles.contradiction", lambda *_, **__: None)  # rows of no real block
    folder = _made(tmp_path)
    for name in ("images", "image_points", "ground_points", "exterior"):
        path = folder / f"{name}.csv"
        lines = path.read_text().splitlines()
        example = next(line[2:] for line in lines if line.startswith("# ") and line.count(",") == lines[-1].count(","))
        more = [example.replace("p1", p) for p in ("p1", "p2", "p3")] if "p1" in example else [example]
        if name == "image_points":
            more = [row.replace("1200.5", f"{1000 * k + 200}.5") for k, row in enumerate(more)]
        if name == "ground_points":
            more = [row.replace("1000.00", f"{1000 + 100 * k}.00") for k, row in enumerate(more)]
        path.write_text("\n".join([*lines, *more]) + "\n")
    block = read_block(folder)
    assert block.images.id.tolist() == ["i1"]
    assert len(block.image_points) == len(block.ground_points) == 3
    assert block.exterior.position_use.tolist() == [1]
    assert len(block.geodetic) == len(block.relative_control) == 0
