"""The documentation is complete: every page is listed, every link leads somewhere, every method is named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INDEX = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
PAGES = sorted((ROOT / "docs").rglob("*.md"))
VARIANTS = sorted(path for path in (ROOT / "stages").glob("*/*.py") if not path.name.startswith("_"))


def _targets(page: Path) -> list[Path]:
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    return [(page.parent / link).resolve() for link in links]


def test_every_page_is_in_the_index() -> None:
    listed = _targets(ROOT / "docs" / "README.md")
    assert [page.name for page in PAGES if page.name != "README.md" and page.resolve() not in listed] == []


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_named_tests_exist(page: Path) -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)`", page.read_text(encoding="utf-8")) if "methods" in page.parts else []
    assert [str(path) for path in [*_targets(page), *(ROOT / name for name in named)] if not path.exists()] == []


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_method_is_named_in_the_index(variant: Path) -> None:
    assert f"`{variant.stem}`" in INDEX or f"`{variant.parent.name}/{variant.stem}`" in INDEX
