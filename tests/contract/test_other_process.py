"""Results do not depend on the process: the order of sets differs with its hash seed."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from tests.contract.digests import digests_of_all


@pytest.mark.slow
def test_a_process_with_another_hash_seed_gives_the_same_digests() -> None:
    environment = {**os.environ, "PYTHONHASHSEED": "12345"}
    command = [sys.executable, "-m", "tests.contract.digests"]
    other = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    here = digests_of_all()
    assert len(here) > 5
    assert json.loads(other.stdout) == here
