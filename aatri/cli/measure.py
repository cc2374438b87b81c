"""`aatri measure`: a page to measure points and fiducial marks in the images of a block folder."""

from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_path, complete_run
from aatri.cli.terminal.console import narrate, reports_errors, say


@reports_errors
def measure(
    block: Annotated[
        Path, typer.Argument(help="Block folder; its images.csv has a column path.", autocompletion=complete_path)
    ],
    run: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN",
            autocompletion=complete_run,
            help="Run folder or pipeline file that tells where points are; default the newest one near the block.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of 127.0.0.1; 0: one that is free.")] = 0,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> None:
    """Measure control points, check points and fiducial marks by hand, on a page that this machine alone serves."""
    import webbrowser

    from aatri.cli.arguments.locate import find_run
    from aatri.errors import ResourceError
    from aatri.measuring.server import MeasuringServer
    from aatri.measuring.session import Session

    session = Session(block, None if run is None else find_run(run).folder)
    try:
        server = MeasuringServer(session, port)
    except OSError as error:
        raise ResourceError(f"port {port}: {error.strerror}", remedy="another --port, or none") from error
    say(server.address)
    narrate("every click is written at once; end with Ctrl+C, then: aatri run")
    if open_ and not webbrowser.open(server.address):
        narrate("no browser to open; open the address above in one of this machine")
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        narrate("ended")
    finally:
        server.server_close()
