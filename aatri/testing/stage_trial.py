"""One call of a stage under observation, and comparison of what came of it. `aatri.testing.check` judges."""

import contextlib
import io
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.errors import AatriError
from aatri.plugin import Options, StageCard
from aatri.progress import Silent
from aatri.tables import hdf5
from aatri.tables.digest import content_digest, table_digest
from aatri.tables.schema import Artifact, Table, attributes_of, columns_of, tables_of


@dataclass(frozen=True)
class Outcome:
    """What a stage returned or raised; `manners`: check -> what was wrong with how it behaved, empty if nothing."""

    artifact: Any = None
    error: Exception | None = None
    manners: Mapping[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Content digest of what it returned; empty if that is no artifact."""
        return content_digest(self.artifact) if isinstance(self.artifact, Artifact) else ""


class Recorder(Silent):
    """A context that notes what no context should be told."""

    def __init__(self) -> None:
        self.faults: list[str] = []

    def log(self, message: str) -> None:
        """Take a line."""
        if not isinstance(message, str) or not message.strip():
            self.faults.append(f"it was told {message!r}")

    def warn(self, message: str) -> None:
        """Take a warning."""
        self.log(message)

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Take how far it is."""
        if not (0 <= done <= total or (done > 0 == total)) or not isinstance(what, str):
            self.faults.append(f"it was told progress {done} of {total}, {what!r}")


def call(card: StageCard, inputs: Mapping[str, Artifact], options: Options | None, *, sparing: bool = False) -> Outcome:
    """Call a stage in an empty folder, listening; `sparing`: with neither options nor context."""
    extras: dict[str, Any] = {"rng": np.random.default_rng(1)} if card.wants_rng else {}
    recorder = Recorder()
    if card.options is not None and not sparing:
        extras["options"] = options
    if card.wants_context and not sparing:
        extras["context"] = recorder
    handed = {port: _copied(value) for port, value in inputs.items()}  # whatever it does to them, ours stay
    artifact, raised, printed = None, None, io.StringIO()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        with contextlib.chdir(folder), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            try:
                artifact = card.function(**handed, **extras)
            except Exception as error:
                raised = error
        files = sorted(path.name for path in Path(folder).iterdir())
    changed = [port for port, value in inputs.items() if content_digest(value) != content_digest(handed[port])]
    noise = [f"it printed {line!r}" for line in printed.getvalue().splitlines()[:3]]
    noise += [f"{w.category.__name__} at {Path(w.filename).name}:{w.lineno}: {w.message}" for w in warned[:3]]
    return Outcome(
        artifact,
        raised,
        {
            "inputs": f"it changed {', '.join(changed)}" if changed else "",
            "quiet": "; ".join(noise),
            "context": "; ".join(recorder.faults[:3]),
            "files": f"it wrote {', '.join(files)}" if files else "",
        },
    )


def _copied(artifact: Artifact) -> Artifact:
    """The artifact with arrays of its own."""
    tables = {name: getattr(artifact, name) for name in tables_of(type(artifact))}
    copies = {name: rows.take(np.arange(len(rows))) if rows is not None else None for name, rows in tables.items()}
    return replace(artifact, **copies)


def difference(one: Artifact, other: Artifact) -> str:
    """Where two artifacts of a kind differ: attributes, and tables with the columns that do."""
    places = [n for n in attributes_of(type(one)) if repr(getattr(one, n)) != repr(getattr(other, n))]
    for name, cls in tables_of(type(one)).items():
        a, b = getattr(one, name), getattr(other, name)
        if (a is None) != (b is None):
            places.append(f"{name} (only one has it)")
        elif a is not None and table_digest(a) != table_digest(b):
            columns = [c for c in columns_of(cls) if not _equal(getattr(a, c), getattr(b, c))]
            places.append(f"{name} ({', '.join(columns)})")
    return f"other content in {', '.join(places)}"


def _equal(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> bool:
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def unlike_its_file(artifact: Artifact) -> str:
    """What is wrong with an artifact once written and read, or with its metrics; empty if nothing."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "artifact.h5"
        try:
            hdf5.write(artifact, path)
            returned = hdf5.read(path, type(artifact))
            if content_digest(returned) != content_digest(artifact):
                return difference(artifact, returned)
            wrong = {k: v for k, v in artifact.metrics().items() if not (v is None or isinstance(v, int | float))}
        except (AatriError, ValueError, TypeError, ArithmeticError) as error:
            return f"{type(error).__name__}: {error}"
    return f"metrics that are no numbers: {wrong}" if wrong else ""


def anonymous(artifact: Artifact) -> Artifact:
    """The artifact with its provenance (columns that are not content) wiped; files whose content counts stay named."""
    wiped = {}
    for name, cls in tables_of(type(artifact)).items():
        rows: Table | None = getattr(artifact, name)
        named = ("path", "mask") if "content" in columns_of(cls) else ()
        columns = [c for c, declared in columns_of(cls).items() if not declared.digest and c not in named]
        if rows is not None and columns:
            wiped[name] = replace(rows, **{c: _wiped(getattr(rows, c)) for c in columns})
    return replace(artifact, **wiped) if wiped else artifact


def _wiped(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.full_like(values, "" if values.dtype.kind == "U" else -1)


def other_rows(block: Block, artifact: Artifact) -> str:
    """Which ids or image points of an artifact are not those of the Block, row by row; empty if all are.

    A stage that makes another Block of it may give it other points.
    """
    if isinstance(artifact, Block):
        return ""
    tables = tables_of(type(artifact))
    wrong: list[str] = [
        name
        for name in ("images", "points")
        if name in tables
        and "id" in columns_of(tables[name])
        and not np.array_equal(getattr(artifact, name).id, getattr(block, name).id)
    ]
    if artifact.kind == "ImagePoints":
        of_block, made = block.image_points, getattr(artifact, "measurements")  # noqa: B009
        if not (np.array_equal(of_block.image, made.image) and np.array_equal(of_block.point, made.point)):
            wrong.append("measurements")
    return f"{', '.join(wrong)} differ" if wrong else ""
