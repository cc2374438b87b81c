"""What a mutator makes of a few lines."""

from __future__ import annotations

from pathlib import Path

from tests.campaigns.mutants import ROOT, equivalents
from tests.campaigns.mutations import is_another_program, mutations
from tests.campaigns.reach import Reach

SOURCE = '''\
"""Text - of the module, 5."""
def f(a: int = 2, *, b: "x - y" = None) -> "1 + 1":
    """Doc > string."""
    total = a + (  # a + b
        b)
    if a < 3 and not b:
        total -= 1.5
    if total != 0:
        raise ValueError(f"{a + 1} is wrong" + "!")
    return [x for x in total if x is None]
'''


def changed_lines(source: str) -> set[tuple[str, ...]]:
    """Lines that differ, of every mutant."""
    old = source.splitlines()
    every = [change.applied(source).splitlines() for change in mutations(source)]
    return {tuple(new.strip() for new in text if new not in old) for text in every}


def test_operators_constants_conditions_lines_and_terms_change_and_no_text_does() -> None:
    assert changed_lines(SOURCE) == {
        ('def f(a: int = 3, *, b: "x - y" = None) -> "1 + 1":',),
        ("total = a - (  # a + b",),
        ("total = (a)",),
        ("if a <= 3 and not b:",),
        ("if a >= 3 and not b:",),
        ("if a < 4 and not b:",),
        ("if a < 3 or not b:",),
        ("if a < 3 and (b):",),
        ("if (a < 3):",),
        ("if (not b):",),
        ("if (not (a < 3 and not b)):",),
        ("total += 1.5",),
        ("total -= 3.0",),
        ("pass",),
        ("if total == 0:",),
        ("if total != 1:",),
        ("return [x for x in total if x is not None]",),
        ("return [x for x in total if True]",),
    }


def test_every_mutant_of_it_is_another_program() -> None:
    assert all(is_another_program(SOURCE, change) for change in mutations(SOURCE))
    lines = [change.line for change in mutations(SOURCE)]
    assert lines == sorted(lines)


def test_letters_beyond_ascii_before_a_change_move_nothing() -> None:
    source = 'µ = "Ä"; σ = 1 + 2\n'
    assert ('µ = "Ä"; σ = 1 - 2',) in changed_lines(source)


def test_a_change_that_says_the_same_is_no_mutant() -> None:
    (change,) = [m for m in mutations("x = a is not b\n") if m.text == "is"]
    assert is_another_program("x = a is not b\n", change)
    assert not is_another_program("x = a\n", type(change)(1, 4, 5, "(a)"))


def test_every_equivalent_mutant_is_one_of_a_line_that_is_there() -> None:
    for file, was, becomes in equivalents():
        lines = [line.strip() for line in (ROOT / file).read_text(encoding="utf-8").splitlines()]
        assert was in lines, (file, was)
        assert becomes != was


# -- test files that the log of called functions names for a changed line --


LOGGED_SOURCE = """\
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
    tests = [reach.tests("aatri/box.py", LOGGED_SOURCE, line) for line in (4, 7, 8, 1)]
    named = ["".join(sorted(t[-4] for t in some)) for some in tests]
    assert named == ["ad", "bd", "cd", "abcd"]
    assert reach.tests("aatri/kernels/box.py", LOGGED_SOURCE, 4) == {f"tests/test_{x}.py" for x in "abcd"}
