"""`aatri run --all-variants`: every variant of a pipeline file after the pipeline itself, then what they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import typer

from aatri.cli.arguments.planning import Opened, open_request
from aatri.cli.terminal.compare_tables import say_side_by_side
from aatri.cli.terminal.console import narrate, report_error, say
from aatri.errors import AatriError, GateError
from aatri.pipeline.plan.compare import read_run


def run_variants(base: Opened, gates: GateError | None, carry_out: Callable[[Opened], GateError | None]) -> None:
    """Run the variants one after the other; one that fails is named and the others go on.

    `gates` says which gates of the pipeline itself failed, `carry_out` gives those of a variant: its results are there.

    Raises
    ------
    typer.Exit
        With the code of the last error, after the comparison, where a variant failed.
    """
    failed: dict[str, AatriError] = {}
    if gates is not None:
        report_error(gates)
        failed[base.spec.run.name] = gates
    compared = [read_run(base.spec.run, base.spec.run.name)]
    for name in base.spec.variants:
        narrate(f"variant {name}")
        try:
            opened = open_request(replace(base.request, variant=name))
            gates = carry_out(opened)
            compared.append(read_run(opened.spec.run, name))
            if gates is not None:
                raise gates
        except AatriError as error:
            report_error(error)
            failed[name] = error
    say()
    say_side_by_side(compared)
    if failed:
        for name, one in failed.items():
            say(f"{name} failed: {one.what}")
        raise typer.Exit(max(one.exit_code for one in failed.values()))
