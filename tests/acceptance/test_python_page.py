"""docs/python.md is run literally: every block of Python, and every output shown is the output; so is the notebook.

APPROVE=1 pytest -m slow tests/acceptance/test_python_page.py     writes the outputs of the page anew
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import re
import shutil
import warnings
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "python.md"
STEP = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", flags=re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_the_page_is_what_happens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib")
    project = Path(shutil.copytree(ROOT / "docs" / "tutorial", tmp_path / "tutorial"))
    monkeypatch.chdir(project)
    page, names = PAGE.read_text(encoding="utf-8"), {"__name__": "page"}

    def step(match: re.Match[str]) -> str:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exec(compile(match[1], str(PAGE), "exec"), names)
        shown = f"\n```text\n{printed.getvalue()}```\n" if printed.getvalue() else ""
        return f"```python\n{match[1]}```\n{shown}"

    happened = STEP.sub(step, page)
    if os.environ.get("APPROVE"):
        PAGE.write_text(happened, encoding="utf-8")
    assert happened == page


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("pandas")
    if importlib.util.find_spec("ipykernel") is None:
        pytest.skip("no kernel for notebooks")
    project = Path(shutil.copytree(ROOT / "docs" / "tutorial", tmp_path / "tutorial"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(ROOT / "examples" / "quarry.ipynb", as_version=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the kernel's own machinery
        made = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(project)}}).execute()
    outputs: list[Any] = [output for cell in made.cells if cell.cell_type == "code" for output in cell.outputs]
    html = "".join(str(output.get("data", {}).get("text/html", "")) for output in outputs)
    assert "<caption>Run run</caption>" in html
    assert "<progress" in html
    assert html.count("data:image/svg+xml") == 2
    assert "5/5 stages" in html
    red = [output["text"] for output in outputs if output.get("name") == "stderr"]
    assert all("UserWarning" in text for text in red)  # what a stage in memory warns of: no progress
