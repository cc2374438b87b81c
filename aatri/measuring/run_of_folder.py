"""The run that tells where points are: the one named, or the newest that oriented images of the block folder."""

import contextlib
from pathlib import Path

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import AatriError, ArtifactError
from aatri.measuring.orientation import RunOrientation
from aatri.pipeline.spec.pipeline_file import load_spec
from aatri.pipeline.store import run_folder as store

PIPELINE = "pipeline.yaml"


def runs_near(folder: Path) -> list[Path]:
    """Runs of the pipelines here and beside a block folder, the newest first."""
    runs = set[Path]()
    for base in {Path.cwd(), folder.resolve().parent}:
        with contextlib.suppress(AatriError, OSError):
            runs.add(load_spec(base / PIPELINE).run)
        runs |= {path.parent for pattern in ("run*/run.json", "runs/*/run.json") for path in base.glob(pattern)}
    return sorted((run for run in runs if (run / "run.json").is_file()), key=_made, reverse=True)


def stamp_of(run: Path) -> tuple[float, ...]:
    """What is another when a run has other results."""
    try:
        return tuple(sorted(path.stat().st_mtime for path in (run / "current").glob("*.json")))
    except OSError:
        return ()


def orientation_of(run: Path, images: list[str]) -> RunOrientation:
    """The last orientation of a run.

    Raises
    ------
    ArtifactError
        If it has none, or none of these images.
    """
    overview = store.read_overview(run)
    if overview is None:
        raise ArtifactError("not the folder of a run", where=str(run), remedy="aatri run makes one")
    records = {str(s["stage"]): store.current_record(run, str(s["stage"])) for s in overview.get("stages", [])}
    for stage, record in reversed(records.items()):
        if record is None or record["output"]["kind"] != Solution.kind:
            continue
        made_of = {port: str(source["stage"]) for port, source in record["inputs"].items()}
        points = made_of.get("image_points") or next(
            (s for s, r in reversed(records.items()) if r and r["output"]["kind"] == ImagePoints.kind), None
        )
        if points is None or "block" not in made_of:
            continue
        solution = store.load(run, stage, Solution)
        if not solution.images.oriented.any():
            continue
        if not set(solution.images.id[solution.images.oriented].tolist()) & set(images):
            raise ArtifactError("has oriented none of the images of this block", where=str(run))
        image_points = store.load(run, points, ImagePoints)
        return RunOrientation(store.load(run, made_of["block"], Block), image_points, solution)
    raise ArtifactError("has no result with oriented images", where=str(run), remedy="aatri run")


def _made(run: Path) -> float:
    return (run / "run.json").stat().st_mtime
