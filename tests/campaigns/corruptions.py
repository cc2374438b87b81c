"""Damage artifacts and records of a run in every way disks, copies and people do: all of it must be found.

    python -m tests.campaigns.corruptions 1000

Bit flips, zeroed pages, truncation, growth, swapped files. After each the plan must want the stage again, and the run
must end with the content digests of the undisturbed one. Made-up stages keep a round short.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

from aatri.pipeline import store
from aatri.pipeline.plan import State
from tests.made_up_stages import write_pipeline
from tests.pipeline.made_runs import digests, planned, run
from tests.pipeline.test_engine import LINES, damage


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    chance, ways = random.Random(given.seed), Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        os.environ["XDG_CACHE_HOME"] = place
        (Path(place) / "data.txt").write_text("1 2 3\n")
        path = write_pipeline(Path(place), LINES)
        _, first = run(path)
        for number in range(given.count):
            stage = chance.choice(sorted(first))
            folder = store.artifact_path(path.parent / "out", stage).parent
            way = damage(folder / chance.choice(["artifact.h5", "record.json"]), chance)
            if planned(path).of(stage).state is not State.run:
                sys.exit(f"{number}: {way} of {stage} was not found")
            made, records = run(path)
            if made != [stage] or digests(records) != digests(first):
                sys.exit(f"{number}: {way} of {stage} was not mended: {made}")
            ways[way] += 1
    sys.stdout.write(f"{given.count} corruptions found and mended: {dict(ways)}\n")


if __name__ == "__main__":
    main()
