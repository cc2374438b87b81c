"""Which test files the log of called functions names for a changed line."""

from __future__ import annotations

from pathlib import Path

from tests.campaigns.reach import Reach

SOURCE = """\
LIMIT = 3
class Box:
    def width(self):
        return [x for x in (lambda: 1,)]
def outer():
    def inner():
        return 1
    return inner
"""


def test_a_changed_line_is_tried_by_the_test_files_that_call_its_function_and_by_unknown_ones(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text(
        "tests/test_a.py\taatri/box.py\tBox.width\ntests/test_b.py\taatri/box.py\touter.<locals>.inner\n"
        "tests/test_c.py\taatri/box.py\touter\n"
    )
    imports = {"aatri/box.py": {"aatri/kernels/box.py"}, "tests/test_a.py": set[str]()}
    reach = Reach(log, {f"tests/test_{x}.py" for x in "abcd"}, imports)
    tests = [reach.tests("aatri/box.py", SOURCE, line) for line in (4, 7, 8, 1)]
    named = ["".join(sorted(t[-4] for t in some)) for some in tests]
    assert named == ["ad", "bd", "cd", "abcd"]
    assert reach.tests("aatri/kernels/box.py", SOURCE, 4) == {f"tests/test_{x}.py" for x in "abcd"}
