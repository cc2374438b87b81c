"""What a worker loads before a stage begins: nothing that takes long and is not needed."""

from __future__ import annotations

import subprocess
import sys

SLOW = ("scipy.stats", "scipy.optimize")


def test_absolute_orientation_and_strip_block_load_no_slow_library_that_most_blocks_do_not_need() -> None:
    code = (
        "import sys; import aatri.stages.absolute_orientation.similarity, aatri.stages.strip_adjustment.polynomial; "
        f"print([name for name in {SLOW} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
