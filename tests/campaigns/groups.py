"""Observations that are wrong together, put into small blocks, and what the chain with default options names.

    python -m tests.campaigns.groups --count 4 [--first 1] [--only strip_shift neighbourhood ...]

Each seed is a block of film and one of a UAV, each spoilt in many ways, one at a time (`WAYS`), after it was oriented;
`clean` is the block as it is. Named is what a warning says that names the group and the cause, `right` the observations
that are rejected though they are right, `others` the groups that are named beside it. A line ends with what is not as
it should be.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.artifacts.suspects import Suspects
from aatri.errors import AatriError
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.wrong_groups import WAYS, Spoilt
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

_FLIGHT = {"strips": 3, "images_per_strip": 6, "cross_strips": 0}
_IMU = {"observed": True, "boresight": "known"}
BLOCKS = {
    "film": {"preset": "rc30", "flight": _FLIGHT, "known": {"full": 12}, "ties": {"new_points": 500}, "imu": _IMU},
    "uav": {"preset": "uav", "flight": _FLIGHT, "known": {"full": 9}, "ties": {"random_per_image": 80.0}, "imu": _IMU},
}
MOST_RIGHT = 0.002
"""Share of all image points that may be rejected though they are right."""


@dataclass(frozen=True)
class Outcome:
    """What became of a spoilt block: whether the group was named, right observations rejected, other groups named."""

    named: bool
    right: int
    others: int
    told: tuple[str, ...]
    bad: tuple[str, ...]


def judged(chain: Chain, spoilt: Spoilt) -> Outcome:
    """Adjust a spoilt block from the orientations of the one without."""
    told, right, failed = Told(), 0, ""
    initial = replace(chain.strip_block, suspects=Suspects.empty())
    try:
        s = bundle(spoilt.block, spoilt.points, initial, options=BundleOptions(max_sigma0=1e9), context=told).suspects
        for kind in np.unique(s.kind[s.staying_out]).tolist():
            rows = s.row[(s.kind == kind) & s.staying_out]
            right += len(np.setdiff1d(rows, spoilt.wrong.get(kind, [])))
    except AatriError as error:
        failed = str(error)
    fits = [
        bool(spoilt.words) and all(any(w in text for w in word.split("|")) for word in spoilt.words)
        for text in told.warnings
    ]
    of_group = ["nothing is rejected in their stead" in text or "are left out;" in text for text in told.warnings]
    named, others = any(fits), sum(group and not fit for group, fit in zip(of_group, fits))
    wanted = named if spoilt.words else not told.warnings
    many = right > max(1, MOST_RIGHT * len(spoilt.points.measurements)) and "heights" not in spoilt.words
    judgements = (("not named", not wanted), ("right ones rejected", many), ("others named", others), (failed, failed))
    return Outcome(named, right, others, tuple(told.warnings), tuple(w for w, is_bad in judgements if is_bad))


def outcomes(seed: int, only: list[str]) -> Iterator[tuple[str, str, Outcome]]:
    """Of one seed all blocks and ways."""
    for name, options in BLOCKS.items():
        chain = run_chain(simulated(seed, **options))
        for k, way in enumerate(WAYS):
            if not only or way.__name__ in only:
                yield name, way.__name__, judged(chain, way(chain, np.random.default_rng([seed, k])))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    chosen = parser.parse_args()
    named, of = Counter[str](), Counter[str]()
    for seed in range(chosen.first, chosen.first + chosen.count):
        for block, way, found in outcomes(seed, chosen.only):
            of[way] += 1
            named[way] += not found.bad
            named_or_not = "named" if found.named else "not named"
            counts = f"{found.right} right ones rejected, {found.others} others named"
            text = f"seed {seed}, {block}, {way}: {named_or_not}, {counts}"
            sys.stdout.write(f"{text}{'  NOT GOOD: ' + ', '.join(found.bad) if found.bad else ''}\n")
            sys.stdout.write("".join(f"        {line[:300]}\n" for line in (found.told if found.bad else ())))
            sys.stdout.flush()
    sys.stdout.write("".join(f"{way}: good in {named[way]} of {of[way]}\n" for way in of))
    sys.exit(0 if all(named[way] >= 0.9 * of[way] for way in of) else 1)


if __name__ == "__main__":
    main()
