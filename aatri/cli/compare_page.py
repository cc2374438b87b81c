"""A page with the pictures of runs side by side, for `aatri compare --page`."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from aatri.pipeline.plan.compare import Compared
from aatri.report.drawing.picture import Picture

_STYLE = (
    "main{max-width:none}.row{display:flex;gap:1em;flex-wrap:wrap}.row>div{flex:1;min-width:20em}svg{max-width:100%}"
)
"""Added to the style of the report, which the pictures are drawn for."""


Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Its head and its rows."""


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
