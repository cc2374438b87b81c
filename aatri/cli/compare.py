"""`aatri compare`: runs side by side, and why they differ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_path, complete_run, one_of_words
from aatri.cli.arguments.options import AsJson
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table
from aatri.errors import SpecError

if TYPE_CHECKING:
    from aatri.pipeline.plan.compare import Compared, Parting


@reports_errors
def compare(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", autocompletion=complete_run, help="Run folders or pipeline files.")
    ],
    variants: Annotated[bool, typer.Option("--variants", help="Compare a run with those of its variants.")] = False,
    everything: Annotated[bool, typer.Option("--all", help="Also figures that are equal.")] = False,
    form: Annotated[
        str,
        typer.Option(
            "--form", autocompletion=one_of_words("markdown", "csv"), help="The key figures to paste: markdown or csv."
        ),
    ] = "",
    page: Annotated[
        Path | None,
        typer.Option(metavar="FILE", autocompletion=complete_path, help="A page with the pictures side by side."),
    ] = None,
    json: AsJson = False,
) -> None:
    """Show key figures and options of runs side by side, the first stage that differs from the first run, and why.

    More than two runs: accuracies, theory and seconds, then what each group of runs changes, most first.
    """
    from aatri.cli.arguments.locate import find_run
    from aatri.cli.terminal.compare_tables import say_side_by_side, shown_value
    from aatri.cli.terminal.key_figures import say_key_figures
    from aatri.pipeline.plan.compare import changes, metric_rows, option_rows, parting, read_run
    from aatri.pipeline.store.inside import VARIANTS, names_in

    folders = [find_run(path).folder for path in runs]
    if variants:
        folders = [
            f for folder in folders for f in (folder, *(folder / VARIANTS / n for n in names_in(folder, VARIANTS)))
        ]
    if len(folders) < 2:
        raise SpecError(
            "one run only", where=str(folders[0]), remedy="give another, or --variants after `aatri run --variant NAME`"
        )
    names = _names(folders)
    compared = [read_run(folder, name) for folder, name in zip(folders, names)]
    options, metrics = option_rows(compared), metric_rows(compared)
    partings = {run.name: parting(compared[0], run) for run in compared[1:]}
    if form:
        from aatri.cli.terminal.key_figures import key_figures, pasted

        if form not in ("markdown", "csv"):
            raise SpecError(f"no form {form!r}", remedy="markdown or csv")
        say(pasted(*key_figures(compared), form))
        return
    if page is not None:
        from aatri.cli.compare_page import write_page
        from aatri.cli.terminal.key_figures import key_figures

        write_page(page, compared, *key_figures(compared))
        say(str(page))
        return
    if json:
        say_json(
            {
                "runs": {run.name: str(run.folder) for run in compared},
                "options": dict(options),
                "metrics": dict(metrics),
                "changes": {
                    run.name: [{"stage": stage, **reason.plain()} for stage, reason in changes(compared[0], run)]
                    for run in compared[1:]
                },
                "differences": {n: _plain(p) for n, p in partings.items()},
            }
        )
        return
    if len(compared) > 2 and not everything:
        say_side_by_side(compared)
    else:
        if len(compared) == 2:
            say_key_figures(compared)
        _say_values("option", names, options, "the options are equal")
        differing = [(n, row) for n, row in metrics if len(set(map(shown_value, row))) > 1 or everything]
        if everything:
            _say_values("figure", names, differing, "the figures are equal")
        else:
            say(
                f"figures that differ, these included: {len(differing)}; --all shows all\n"
                if differing
                else "the figures are equal\n"
            )
    for run in compared[1:]:
        for stage, reason in changes(compared[0], run):
            if reason.why != "options":  # these stand in the table
                say(f"{run.name}: changed: {stage}: {reason}")
        missing = [stage for stage in compared[0].stages if stage not in run.records]
        without = f"; it has no result of {', '.join(missing)}" if missing else ""
        say(f"{run.name}: {_parting_text(partings[run.name], compared[0])}{without}")


def _names(folders: list[Path]) -> list[str]:
    """Short names that tell the runs apart."""
    short = [folder.name for folder in folders]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def _say_values(what: str, names: list[str], rows: list[tuple[str, list[Any]]], otherwise: str) -> None:
    from aatri.cli.terminal.compare_tables import shown_value

    if rows:
        say_table((what, *names), [[name, *map(shown_value, row)] for name, row in rows], names)
    else:
        say(otherwise)
    say()


def _parting_text(split: Parting | None, first: Compared) -> str:
    """One sentence on where and why a run parts from the first one."""
    if split is None:
        return f"its results are equal to those of {first.name}"
    from aatri.cli.plan_table import reasons_text

    changed = [f"{name} {one} -> {other}" for name, (one, other) in split.environment.items()]
    reason_text = reasons_text(split.reasons) or (
        "the environment" if changed else "the same stage gave another result"
    )
    size = "only the last bits" if split.only_last_bits else "more than the last bits"
    scale = f", largest relative difference {split.largest:.1e}" if split.largest < float("inf") else ""
    more = f"; environment: {', '.join(changed)}" if changed else ""
    return f"parts from {first.name} at stage {split.stage}: {reason_text} ({size}{scale}){more}"


def _plain(split: Parting | None) -> dict[str, Any] | None:
    if split is None:
        return None
    return {
        "stage": split.stage,
        "reasons": [reason.plain() for reason in split.reasons],
        "environment": split.environment,
        "only_last_bits": split.only_last_bits,
        "largest_relative_difference": split.largest if split.largest < float("inf") else None,
    }
