"""`aatri run --all-variants`: every variant of a pipeline file after the pipeline itself, then what they change."""

from collections.abc import Callable
from dataclasses import replace

import typer

from aatri.cli.arguments.planning import Opened, open_request
from aatri.cli.run_ending import judgement
from aatri.cli.terminal.compare_tables import say_side_by_side
from aatri.cli.terminal.console import narrate, report_error, say
from aatri.errors import AatriError, GateError
from aatri.pipeline.plan.compare import Compared, read_run


def run_variants(base: Opened, gates: GateError | None, carry_out: Callable[[Opened], GateError | None]) -> None:
    """Run the variants one after the other, and say what they change.

    `gates` says which gates of the pipeline itself failed, `carry_out` gives those of a variant: its results are there.

    Raises
    ------
    typer.Exit
        With the code of the last error, after the comparison, where a variant failed.
    """
    compared, failed = made_variants(base, gates, carry_out)
    say()
    say_side_by_side(compared)
    for run in compared:
        if text := judgement(run.folder / "report.json"):
            say(f"{run.name}: {text}")
    say_failures(failed)


def made_variants(
    base: Opened, gates: GateError | None, carry_out: Callable[[Opened], GateError | None]
) -> tuple[list[Compared], dict[str, AatriError]]:
    """The pipeline and its variants as run, and the errors by name; one that fails is named and the others go on."""
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
    return compared, failed


def say_failures(failed: dict[str, AatriError]) -> None:
    """Name what failed.

    Raises
    ------
    typer.Exit
        With the largest of the codes, where anything did.
    """
    for name, error in failed.items():
        say(f"{name} failed: {error.what}")
    if failed:
        raise typer.Exit(max(error.exit_code for error in failed.values()))
