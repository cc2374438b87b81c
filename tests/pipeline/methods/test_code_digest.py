from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from aatri.pipeline.methods.code_digest import PACKAGE, CodeReader
from aatri.pipeline.store.cache import Cache

FILES = {
    "__init__.py": "from toy import noise\n",
    "stage.py": '"""A stage."""\nfrom toy import near\nfrom toy.far import reach\nfrom .deep.below import floor\n'
    "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from toy.types_only import T\n"
    "else:\n    from toy import real\n"
    "def stage():\n    from toy.late import run\n    import numpy\n",
    "near.py": "X = 1\n",
    "far.py": "from aatri.ids import shown\ndef reach(): pass\n",
    "deep/__init__.py": "",
    "deep/below.py": "from ..up import Y\nfloor = 1\n",
    "up.py": "Y = 1\n",
    "late.py": "def run(): pass\n",
    "real.py": "T = int\n",
    "types_only.py": "T = int\n",
    "noise.py": "",
    "unrelated.py": "",
}


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / "toy" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "toy"


def digest(toy: Path) -> str:
    return CodeReader(Cache(None)).code_of("toy.stage", toy / "stage.py").digest


def test_the_closure_holds_what_is_reached_and_nothing_else(toy: Path) -> None:
    code = CodeReader(Cache(None)).code_of("toy.stage", toy / "stage.py")
    assert set(code.files) == {
        "toy.stage",
        "toy.near",
        "toy.far",
        "toy.deep.below",
        "toy.up",
        "toy.late",
        "toy.real",
        "aatri.ids",
        "aatri.errors",
    }


def test_what_a_function_imports_is_reached_but_not_at_once(toy: Path) -> None:
    code = CodeReader(Cache(None)).code_of("toy.stage", toy / "stage.py")
    assert set(code.files) - code.at_once == {"toy.late"}
    assert code.at_once < set(code.files)


def test_a_built_in_stage_reaches_its_library_and_not_the_pipeline() -> None:
    path = PACKAGE.parent / "stages" / "interior_orientation" / "affine.py"
    files = CodeReader(Cache(None)).code_of("aatri.stages.interior_orientation.affine", path).files
    assert {"aatri.orientation.interior.fiducial_fit", "aatri.plugin", "aatri.tables.schema"} <= set(files)
    assert not [name for name in files if name.startswith(("aatri.pipeline", "aatri.cli", "aatri.report"))]


def test_every_folder_is_looked_at_once_however_many_names_are_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = Counter[str]()
    listing = os.scandir

    def counted(folder: str) -> Iterator[os.DirEntry[str]]:
        listed[folder] += 1
        return listing(folder)

    monkeypatch.setattr(os, "scandir", counted)
    path = PACKAGE.parent / "stages" / "interior_orientation" / "affine.py"
    assert CodeReader(Cache(None)).code_of("aatri.stages.interior_orientation.affine", path).files
    assert set(listed.values()) == {1}


@pytest.mark.parametrize("name", ["stage.py", "near.py", "far.py", "deep/below.py", "up.py", "late.py", "real.py"])
def test_an_edit_in_any_file_reached_changes_the_digest(toy: Path, name: str) -> None:
    before = digest(toy)
    (toy / name).write_text(FILES[name] + "Z = 1\n")
    assert digest(toy) != before


@pytest.mark.parametrize("name", ["__init__.py", "unrelated.py", "types_only.py", "deep/__init__.py", "noise.py"])
def test_an_edit_elsewhere_does_not(toy: Path, name: str) -> None:
    before = digest(toy)
    (toy / name).write_text(FILES[name] + "Z = 1\n")
    assert digest(toy) == before


def test_comments_blank_lines_and_docstrings_do_not_count(toy: Path) -> None:
    before = digest(toy)
    (toy / "late.py").write_text('"""Late."""\n# a remark\n\n\ndef run():\n    """Run."""\n    pass\n')
    text = FILES["stage.py"].replace('"""A stage."""', '"""Another text."""  # so')
    (toy / "stage.py").write_text(text)
    assert digest(toy) == before
    (toy / "late.py").write_text("def run(): 'not a docstring' + ''\n")
    assert digest(toy) != before


def test_a_second_edit_of_equal_size_within_a_tick_of_the_clock_is_seen(toy: Path, tmp_path: Path) -> None:
    cache = Cache(tmp_path / "cache.json")
    digests = set()
    for value in range(5):
        (toy / "near.py").write_text(f"X = {value}\n")
        digests.add(CodeReader(cache).code_of("toy.stage", toy / "stage.py").digest)
        cache.save()
    assert len(digests) == 5


def test_a_damaged_cache_is_as_good_as_none(toy: Path, tmp_path: Path) -> None:
    (tmp_path / "cache.json").write_text('{"a": ')
    assert CodeReader(Cache(tmp_path / "cache.json")).code_of("toy.stage", toy / "stage.py").digest == digest(toy)
