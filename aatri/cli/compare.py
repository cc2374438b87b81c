"""`aatri compare`: runs side by side, and why they differ; for `--page` a page with their pictures side by side."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_path, complete_run, one_of_words
from aatri.cli.arguments.options import AsJson
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table
from aatri.errors import SpecError
from aatri.pipeline.plan.compare import Compared
from aatri.report.drawing.picture import Picture

if TYPE_CHECKING:
    from aatri.pipeline.plan.compare import Compared, Parting

_STYLE = (
    "main{max-width:none}.row{display:flex;gap:1em;flex-wrap:wrap}.row>div{flex:1;min-width:20em}svg{max-width:100%}"
)
"""Added to the style of the report, which the pictures are drawn for."""


Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Its head and its rows."""

Rows = list[tuple[str, list[Any]]]
"""Name of a figure or an option, and its value in each run."""


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
    from aatri.cli.terminal.compare_tables import say_side_by_side
    from aatri.pipeline.plan.compare import metric_rows, option_rows, read_run
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
    compared = [read_run(folder, name) for folder, name in zip(folders, _names(folders))]
    options, metrics = option_rows(compared), metric_rows(compared)
    if form:
        from aatri.cli.terminal.key_figures import key_figures, pasted

        if form not in ("markdown", "csv"):
            raise SpecError(f"no form {form!r}", remedy="markdown or csv")
        say(pasted(*key_figures(compared), form))
        return
    if page is not None:
        from aatri.cli.terminal.key_figures import key_figures

        changed = _parting_lines(compared)
        write_page(page, compared, [key_figures(compared), _values_table("option", compared, options)], changed)
        say(str(page))
        return
    if json:
        say_json(_plain_comparison(compared, options, metrics))
        return
    if len(compared) > 2 and not everything:
        say_side_by_side(compared)
    else:
        _say_figures(compared, options, metrics, everything=everything)
    say("\n".join(_parting_lines(compared)))


def _plain_comparison(compared: list[Compared], options: Rows, metrics: Rows) -> dict[str, Any]:
    """What is compared, as JSON takes it."""
    from aatri.pipeline.plan.compare import changes, parting

    first, others = compared[0], compared[1:]
    return {
        "runs": {run.name: str(run.folder) for run in compared},
        "options": dict(options),
        "metrics": dict(metrics),
        "changes": {
            run.name: [{"stage": stage, **reason.plain()} for stage, reason in changes(first, run)] for run in others
        },
        "failed": {run.name: {stage: f.get("what") for stage, f in run.failures.items()} for run in compared},
        "differences": {run.name: _plain(parting(first, run)) for run in others},
    }


def _say_figures(compared: list[Compared], options: Rows, metrics: Rows, *, everything: bool) -> None:
    """Key figures of two runs, options, and figures: those that differ are counted, all are shown where asked for."""
    from aatri.cli.terminal.compare_tables import shown_value
    from aatri.cli.terminal.key_figures import say_key_figures

    apart = len(compared) == 2 and not compared[0].records.keys() & compared[1].records.keys()
    if len(compared) == 2:
        say_key_figures(compared)
    if options or not apart:
        _say_values("option", compared, options)
    if apart:
        return
    if everything:
        _say_values("figure", compared, metrics)
        return
    differing = sum(len(set(map(shown_value, row))) > 1 for _, row in metrics)
    counted = f"figures that differ, these included: {differing}; --all shows all" if differing else ""
    say(f"{counted or 'the figures are equal'}\n")


def _parting_lines(compared: Sequence[Compared]) -> list[str]:
    """What failed in the first run, then of each other what `_lines_of` says."""
    first, *others = compared
    return [*_failed_lines(first), *(line for run in others for line in _lines_of(run, first))]


def _failed_lines(run: Compared) -> list[str]:
    return [f"{run.name}: {stage} failed: {failure.get('what', '')}" for stage, failure in run.failures.items()]


def _lines_of(run: Compared, first: Compared) -> list[str]:
    """What is changed in a run, where its results part from those of the first one, and what it lacks."""
    from aatri.pipeline.plan.compare import changes, parting

    changed = [
        f"{run.name}: changed: {stage}: {reason}"
        for stage, reason in changes(first, run)
        if reason.why != "options"  # these stand in the table
    ]
    missing = [stage for stage in first.stages if stage not in run.records and stage not in run.failures]
    without = f"; it has no result of {', '.join(missing)}" if missing else ""
    if not first.records.keys() & run.records.keys():
        end = f"no stage that {first.name} has a result of has one here: nothing to compare"
    else:
        split = parting(first, run)
        complete = all(stage in each.records for each in (first, run) for stage in each.stages)
        equal = f"its results are equal to those of {first.name}" if complete else "what both have is equal"
        end = f"{equal if split is None else _parting_text(split, first)}{without}"
    return [*changed, *_failed_lines(run), f"{run.name}: {end}"]


def _names(folders: list[Path]) -> list[str]:
    """Short names that tell the runs apart."""
    short = [folder.name for folder in folders]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def _values_table(what: str, compared: list[Compared], rows: Rows) -> tuple[list[str], list[list[str]]]:
    from aatri.cli.terminal.compare_tables import shown_value

    return [what, *(run.name for run in compared)], [[name, *map(shown_value, row)] for name, row in rows]


def _say_values(what: str, compared: list[Compared], rows: Rows) -> None:
    if rows:
        head, lines = _values_table(what, compared, rows)
        say_table(head, lines, head[1:])
    else:
        say(f"the {what}s are equal")
    say()


def _parting_text(split: Parting, first: Compared) -> str:
    """One sentence on where and why a run parts from the first one."""
    from aatri.cli.plan_table import reasons_text

    changed = [f"{name} {one} -> {other}" for name, (one, other) in split.environment.items()]
    reason_text = reasons_text(split.reasons) or (
        "the environment" if changed else "the same stage gave another result"
    )
    size = "results differ by rounding alone" if split.only_last_bits else "results differ by more than rounding"
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


def write_page(path: Path, runs: Sequence[Compared], tables: Sequence[Table], changed: Sequence[str]) -> None:
    """Write the key figures, what was changed, and every picture that one of the runs has, a column a run."""
    from aatri.cli.run_ending import judgement
    from aatri.formats.text.written_files import write_files
    from aatri.report.page import seen_in
    from aatri.report.questions import gallery

    verdicts = [escape(judgement(run.folder / "report.json")) for run in runs]
    pictures = [gallery(*seen_in(run.folder)).pictures for run in runs]
    parts = [f"<h1>{escape(' and '.join(run.name for run in runs))}</h1>"]
    parts += [f"<p><b>{escape(run.name)}</b>: {text}</p>" for run, text in zip(runs, verdicts) if text]
    parts += [_table(head, rows) for head, rows in tables if rows]
    parts += [f'<p class="help">{escape(line)}</p>' for line in changed]
    for name in dict.fromkeys(name for shown in pictures for name in shown):
        title = next(shown[name].title for shown in pictures if name in shown)
        columns = [
            f"<div><p>{escape(run.name)}</p>{_figure(shown[name]) if name in shown else 'none'}</div>"
            for run, shown in zip(runs, pictures)
        ]
        parts.append(f'<h2>{escape(title)}</h2><div class="row">{"".join(columns)}</div>')
    rendered = [page for run in runs if (page := run.folder / "report.html").is_file()]
    style = rendered[0].read_text(encoding="utf-8").partition("<style>")[2].partition("</style>")[0] if rendered else ""
    start = f'<!doctype html><html lang="en"><meta charset="utf-8"><style>{style}{_STYLE}</style><main>'
    write_files(path.parent, {path.name: f"{start}{''.join(parts)}</main></html>\n"})


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return f'<div class="wide"><table>{_row("th", head)}{"".join(_row("td", row) for row in rows)}</table></div>'


def _row(tag: str, cells: Sequence[str]) -> str:
    first, *others = (escape(cell) for cell in cells)
    return "".join(
        ["<tr>", f"<{tag}>{first}</{tag}>", *(f'<{tag} class="n">{cell}</{tag}>' for cell in others), "</tr>"]
    )


def _figure(picture: Picture) -> str:
    from aatri.report.drawing.svg import drawn

    return f"<figure>{drawn(picture)}<figcaption>{escape(picture.caption)}</figcaption></figure>"
