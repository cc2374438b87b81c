"""Random edits of options, files and code on random graphs of stages: the planner wants exactly the dependent ones.

    python -m tests.campaigns.edits_of_plans 1000

Every example makes five edits.
"""

from __future__ import annotations

import argparse
import sys

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.pipeline.plan.test_decisions import check_random_edits, graphs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    count = parser.parse_args().count
    examples = settings(max_examples=-(-count // 5), deadline=None, database=None)
    examples(given(graphs(), st.integers(0, 10**9))(check_random_edits))()
    sys.stdout.write(f"{count} edits: exactly the dependent stages were made again\n")


if __name__ == "__main__":
    main()
