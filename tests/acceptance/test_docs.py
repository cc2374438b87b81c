"""The documentation is complete: every page is listed, every link leads somewhere, every method is named."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest

import aatri

ROOT = Path(__file__).parents[2]
INDEX = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
PAGES = sorted((ROOT / "docs").rglob("*.md"))
TEXTS = [
    path
    for folder in ("aatri", "stages", "docs")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in (".py", ".md")
]
FILES = [
    path.relative_to(ROOT).as_posix()
    for top in ("aatri", "stages", "tests", "docs", "benchmarks")
    for path in (ROOT / top).rglob("*.py")
]
VARIANTS = sorted(path for path in (ROOT / "stages").glob("*/*.py") if not path.name.startswith("_"))


def _targets(page: Path) -> list[Path]:
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    return [(page.parent / link).resolve() for link in links]


def test_every_page_is_in_the_index() -> None:
    listed = _targets(ROOT / "docs" / "README.md")
    assert [page.name for page in PAGES if page.name != "README.md" and page.resolve() not in listed] == []


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=lambda page: str(page.relative_to(ROOT))
)
def test_links_and_named_tests_exist(page: Path) -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)`", page.read_text(encoding="utf-8")) if "methods" in page.parts else []
    assert [str(path) for path in [*_targets(page), *(ROOT / name for name in named)] if not path.exists()] == []


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_method_is_named_in_the_index(variant: Path) -> None:
    assert f"`{variant.stem}`" in INDEX or f"`{variant.parent.name}/{variant.stem}`" in INDEX


def test_every_cited_formula_is_in_the_collection() -> None:
    formulas = set(re.findall(r"^### (\d+\.\d+) ", (ROOT / "docs" / "formulas.md").read_text(encoding="utf-8"), re.M))
    cited = {
        (str(path.relative_to(ROOT)), number)
        for path in TEXTS
        for numbers in re.findall(
            r"formulas\.md\s+(\d+\.\d+(?:[^.;:]{0,16}?,\s+\d+\.\d+)*)", path.read_text(encoding="utf-8")
        )
        for number in re.findall(r"\d+\.\d+", numbers)
    }
    assert len(cited) >= 25
    assert sorted((path, number) for path, number in cited if number not in formulas) == []


def test_nothing_is_cited_that_is_not_in_the_repository() -> None:
    """Code and pages name a `.md` file by its path in the repository, from its own folder or by its name alone."""
    names = {page.name for page in [*PAGES, *ROOT.glob("*.md")]}
    cited = {
        (str(path.relative_to(ROOT)), Path(name).name)
        for path in TEXTS
        for name in re.findall(r"[\w./-]+\.md\b", path.read_text(encoding="utf-8"))
    }
    assert sorted((path, name) for path, name in cited if name not in names) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_of_the_code_that_a_page_names_exist(page: Path) -> None:
    """By their path, or by the end of it; what stands for another name (`ROLE`, `mine.py`) is none."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    named = {name for name in re.findall(r"`([\w/]+\.py)`", text) if "mine" not in name and name == name.lower()}
    assert sorted(name for name in named if not any(f"/{path}".endswith(f"/{name}") for path in FILES)) == []


def test_the_method_table_has_every_row_of_the_inventory_once_and_names_tests_that_are_there() -> None:
    """16 chapters of rows A101 to A1605, 151 of them."""
    page = (ROOT / "docs" / "method_table.md").read_text(encoding="utf-8").partition("## Every method")[0]
    rows = re.findall(r"^\| (A\d{3,4}) \|", page, flags=re.M)
    assert len(rows) == len(set(rows)) == 151
    tests = re.findall(r"[a-z_]+(?:/[a-z_]+)*/test_\w+\.py", page)
    assert [path for path in tests if not (ROOT / "tests" / path).is_file()] == []


# The examples in docstrings are what comes out.


HOUSE = Path(aatri.__file__).parent
MODULES = sorted(path for path in HOUSE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", MODULES, ids=[path.stem for path in MODULES])
def test_examples_are_what_comes_out(path: Path) -> None:
    name = ".".join(path.relative_to(HOUSE.parent).with_suffix("").parts)
    outcome = doctest.testmod(importlib.import_module(name))
    assert outcome.attempted > 0
    assert outcome.failed == 0
