"""`aatri formats`: every format of other programs, what it carries, what it cannot carry."""

from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_format
from aatri.cli.arguments.options import AsJson
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table


@reports_errors
def formats(
    name: Annotated[
        str | None, typer.Argument(metavar="[FORMAT]", autocompletion=complete_format, help="One format.")
    ] = None,
    json: AsJson = False,
) -> None:
    """List the formats, or describe one: how it is recognised, what it carries and what not, what reads it."""
    from aatri.formats.registry.catalogue import FORMATS
    from aatri.formats.registry.recognised import format_named

    listed = [format_named(name)] if name else list(FORMATS)
    described = [
        {
            "name": f.name,
            "title": f.title,
            "recognised_by": f.looked_for,
            "carries": list(f.carries),
            "does_not_carry": list(f.drops),
            "read_by": f.stage or ("block/combined" if f.read else ""),
            "writes": list(f.written) if f.write else [],
            "page": f.page,
        }
        for f in listed
    ]
    if json:
        say_json(described)
    elif name:
        for key, value in described[0].items():
            say(f"{key.replace('_', ' '):<16}{', '.join(value) if isinstance(value, list) else value}")
    else:
        rows = [
            [str(d["name"]), str(d["title"]), str(d["read_by"]), "yes" if d["writes"] else "", ", ".join(d["carries"])]
            for d in described
        ]
        say_table(("format", "title", "read by", "written", "carries"), rows)
        say()
        say("`aatri formats FORMAT` says by what a format is recognised, and what it does not carry")
