"""Every verb shows examples in its help, and every example is one that the verb takes."""

from __future__ import annotations

import shlex
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from aatri.cli.examples import EXAMPLES
from aatri.cli.main import VERBS, app


@pytest.mark.parametrize("verb", VERBS)
def test_help_has_examples_that_the_verb_takes(verb: str) -> None:
    shown = CliRunner().invoke(app, [verb, "--help"]).stdout
    command: Any = typer.main.get_command(app)
    command = command.get_command(None, verb)
    assert "Examples:" in shown
    for text, what in EXAMPLES[verb]:
        assert f"aatri {text} " in shown
        assert what in shown
        name, *arguments = shlex.split(text.partition(" | ")[0])
        assert name == verb
        command.make_context(verb, arguments)  # refuses what it does not know


def test_no_example_without_a_verb() -> None:
    assert set(EXAMPLES) == set(VERBS)
