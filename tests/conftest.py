"""Fixtures shared by all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from aatri.pipeline.methods.kernel_cache import use_kernel_cache

# before Numba is imported: an edit of a kernel leads to another folder, in the processes of tests too
use_kernel_cache()

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Caches of the tests are their own; compiled code is shared by them, for it takes long to make."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real data sets; tests that need it are skipped where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"real data not present: {SHARED_DATA}")
    return SHARED_DATA
