"""The report as PDF, printed by a browser that is on the machine: Chromium, Chrome or Edge, without a window."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from aatri.errors import ResourceError
from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import on_disk
from aatri.report.page import angles_of, page_contents, refuse_others, render, seen_in
from aatri.report.view.numbers import angles_in

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
LONGEST_S = 300


def write_pdf(run: Path, *, summary: bool = False) -> Path:
    """Write `report.pdf`, or `summary.pdf` of two pages, into a run folder.

    Raises
    ------
    ResourceError
        If there is no browser, or it fails.
    ArtifactError
        If the folder is no run, or has a file of this name that is another's.
    """
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        remedy = "install Chromium, or open report.html in a browser and print it"
        raise ResourceError("no Chromium, Chrome or Edge is on this machine to print the report", remedy=remedy)
    name = "summary.pdf" if summary else "report.pdf"
    refuse_others(run, (name,))
    with angles_in(angles_of(run)):
        seen, around = seen_in(run)
        contents = page_contents(seen, around, stages=not summary)
        page = render(seen, around, contents, printed=True, summary=summary)
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        options = [
            "--headless",
            "--disable-gpu",
            f"--user-data-dir={folder}/browser",
            "--no-first-run",
            "--no-pdf-header-footer",
            f"--print-to-pdf={target}",
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            options.append("--no-sandbox")  # Chromium has none for root, as in containers
        try:
            done = subprocess.run(
                [browser, *options, source.as_uri()], capture_output=True, text=True, timeout=LONGEST_S, check=False
            )
            lines = done.stderr.strip().splitlines()
        except (OSError, subprocess.TimeoutExpired) as error:
            lines = [str(error)]
        if not target.is_file():
            words = lines[-1] if lines else "without a word"
            raise ResourceError(f"did not print the report: {words}", where=browser, remedy="print report.html by hand")
        with on_disk(run / name):
            inside.write(target.read_bytes(), run, name)
    return run / name
