"""Numba that a notebook has imported, or used, before aatri takes the compiled kernels from the cache all the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.pipeline.methods.toy_kernels import clone

pytest.importorskip("numba")

USED = {
    "imported": "import numba",
    "used": "import numba; numba.njit('float64(float64)')(lambda x: x + 1.0)",
}
CALL = """
{before}
import os
from pathlib import Path
from aatri.pipeline.methods.compile_kernels import Compilation
from aatri.pipeline.methods.kernel_cache import use_kernel_cache
use_kernel_cache()
kernels = {{f"field.kernels.{{n}}": Path(r"{clone}") / "field" / "kernels" / f"{{n}}.py" for n in ("inner", "outer")}}
Compilation(kernels).wait()
from field.kernels.inner import twice
from field.kernels.outer import more
print([sum(function.stats.cache_hits.values()) for function in (twice, more)], more(3.0))
"""


@pytest.mark.slow
@pytest.mark.parametrize("before", USED)
def test_numba_of_a_notebook_compiles_no_kernel_again(before: str, tmp_path: Path) -> None:
    clone(tmp_path / "clone", 2.0)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    path = os.pathsep.join([str(tmp_path / "clone"), *filter(None, sys.path)])
    environment |= {"NUMBA_CACHE_DIR": str(tmp_path / "numba"), "PYTHONPATH": path}
    code = CALL.format(before=USED[before], clone=tmp_path / "clone")
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "[1, 1] 7.0\n"
    assert not list((tmp_path / "clone").rglob("*.nbi")), "beside the code nothing is kept"
