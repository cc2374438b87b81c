"""Which pipeline a run folder may lead to: its run.json can come from anyone, and name any file.

The pipeline lies in a folder above the run, which is one project; or the user has made the run on this machine, of
which a note is kept in the user's cache.
"""

import os
from pathlib import Path

from aatri.pipeline.store.cache import Cache, cache_folder

SUFFIXES = (".yaml", ".yml")


def _notes() -> Cache:
    return Cache(cache_folder() / "runs.json")


def remember(run: Path, pipeline: str) -> None:
    """Note that the user runs this pipeline into this folder."""
    notes, place = _notes(), os.path.realpath(run)
    if pipeline and notes.get(place) != os.path.realpath(pipeline):
        notes.put(place, os.path.realpath(pipeline))
        notes.save()


def is_of_this_run(run: Path, pipeline: Path) -> bool:
    """Whether a pipeline that a run.json names may be opened."""
    real, place = Path(os.path.realpath(pipeline)), Path(os.path.realpath(run))
    in_project = real.parent in place.parents and real.suffix in SUFFIXES
    return in_project or _notes().get(str(place)) == str(real)
