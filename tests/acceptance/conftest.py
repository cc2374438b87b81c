"""A small film block as the tables of a folder, and a project with the whole chain on a copy of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.acceptance.small_block import SIMULATE, TABLES, aatri, write_pipeline


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tables, not to be changed."""
    folder = tmp_path_factory.mktemp("good")
    assert aatri("run", "-q", write_pipeline(folder, SIMULATE, stages="")).exit_code == 0
    assert aatri("export", f"{folder / 'run'}:block", "tables", folder / "block").exit_code == 0
    return folder / "block"


@pytest.fixture
def project(tmp_path: Path, exported: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own with the tables and a pipeline, which is the current folder."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(exported, tmp_path / "block")
    write_pipeline(tmp_path, TABLES)
    return tmp_path
