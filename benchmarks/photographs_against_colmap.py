"""Photographs to an adjusted block beside COLMAP's chain, in one run: processor time, images, principal distance.

    python -m benchmarks.photographs_against_colmap FOLDER [--most 4000]

aatri: `aatri new --block photos`, then `aatri run` from the interpreter's start to the report; compiled functions are
made before, by the same command. COLMAP (pycolmap, on the processor, one thread): features, matches of the pairs that
aatri took, incremental mapping; camera RADIAL, which holds the principal point. Both take `--most` features.

The principal distances of the two hang on what is unknown beside them. So aatri's bundle adjusts COLMAP's own image
points with COLMAP's own unknowns (c, k1, k2), too: that comparison sees the adjustment alone.
"""

from __future__ import annotations

import argparse
import itertools
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

AATRI = "from aatri.cli.main import main; main()"


def main() -> None:
    """Run both, and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--most", type=int, default=4000, help="features of an image at most")
    parser.add_argument("--part", choices=("colmap", "pairs", "same"), help=argparse.SUPPRESS)
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.part:
        parts = {"colmap": _colmap, "pairs": _pairs, "same": _same_unknowns}
        sys.stdout.write(json.dumps(parts[asked.part](asked.folder.resolve(), asked.into, asked.most)))
        return
    with tempfile.TemporaryDirectory() as name:
        into = Path(name)
        _seconds([AATRI, "new", str(into / "b"), str(asked.folder.resolve()), "--block", "photos"])
        run = [AATRI, "run", str(into / "b" / "pipeline.yaml"), "-q", "--set", f"block.most={asked.most}"]
        _seconds([*run, "--into", str(into / "before"), "--until", "bundle"])  # compiles
        ours = _seconds([*run, "--into", str(into / "run")])
        told: dict[str, Any] = {}
        for part in ("pairs", "colmap", "same"):
            script = [__file__, str(asked.folder), "--most", str(asked.most), "--part", part, "--into", str(into)]
            done = subprocess.run([sys.executable, *script], capture_output=True, text=True, check=True)
            told |= json.loads(done.stdout.splitlines()[-1])
    theirs = sum(told["seconds"])
    parts = ", ".join(f"{s:.1f}" for s in told["seconds"])
    rows = (
        f"aatri   {ours:.1f} s, {told['images']} images, c {told['c_px']:.1f} px with all of the camera free",
        f"COLMAP  {theirs:.1f} s ({parts}), {told['their_images']} images, c {told['their_c_px']:.1f} px",
        f"aatri by COLMAP   {ours / theirs:.2f}",
        f"aatri's bundle of COLMAP's image points with its unknowns   c {told['same_c_px']:.1f} px, by COLMAP's "
        f"{told['same_c_px'] / told['their_c_px']:.5f}",
    )
    sys.stdout.write("\n".join(rows) + "\n")


def _seconds(words: list[str]) -> float:
    """Processor time of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", *words], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _pairs(folder: Path, into: Path, _: int) -> dict[str, Any]:
    """What aatri came to, and its pairs as a list for COLMAP."""
    import numpy as np

    import aatri
    from aatri.pixels.matching import near_pairs

    run = aatri.open(into / "run")
    block, bundle = run["block"].artifact, run["bundle"].artifact
    position_m = np.full((len(block.images), 3), np.nan)
    position_m[block.exterior.image] = block.exterior.position_m
    names = [Path(path).relative_to(folder).as_posix() for path in block.images.path.tolist()]
    pairs = near_pairs(position_m, 8)
    (into / "pairs.txt").write_text("".join(f"{names[i]} {names[j]}\n" for i, j in pairs.tolist()), encoding="utf-8")
    c_px = float(bundle.cameras.principal_distance_mm[0] / block.cameras.pixel_size_mm[0, 0])
    return {"c_px": c_px, "images": int(np.isfinite(bundle.images.position_m[:, 0]).sum())}


def _colmap(folder: Path, into: Path, most: int) -> dict[str, Any]:
    """COLMAP's chain; its model is written."""
    import pycolmap

    pycolmap.logging.minloglevel = 2
    cpu, database, at = pycolmap.Device.cpu, into / "database.db", [_own_seconds()]
    extraction, reading = pycolmap.FeatureExtractionOptions(), pycolmap.ImageReaderOptions()
    extraction.use_gpu, extraction.num_threads, extraction.sift.max_num_features = False, 1, most
    reading.camera_model = "RADIAL"
    pycolmap.extract_features(
        database, folder, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reading,
        extraction_options=extraction, device=cpu,
    )  # fmt: skip
    at.append(_own_seconds())
    matching, pairing = pycolmap.FeatureMatchingOptions(), pycolmap.ImportedPairingOptions()
    matching.use_gpu, matching.num_threads, pairing.match_list_path = False, 1, into / "pairs.txt"
    pycolmap.match_image_pairs(database, matching_options=matching, pairing_options=pairing, device=cpu)
    at.append(_own_seconds())
    mapping = pycolmap.IncrementalPipelineOptions()
    mapping.num_threads, mapping.random_seed = 1, 1
    models = pycolmap.incremental_mapping(database, folder, into / "sparse", options=mapping)
    at.append(_own_seconds())
    best = max(models.values(), key=lambda model: model.num_reg_images())
    (into / "model").mkdir()
    best.write_text(into / "model")
    c_px = float(next(iter(best.cameras.values())).params[0])
    seconds = [b - a for a, b in itertools.pairwise(at)]
    return {"seconds": seconds, "their_images": best.num_reg_images(), "their_c_px": c_px}


def _same_unknowns(_: Path, into: Path, __: int) -> dict[str, Any]:
    """c of aatri's bundle, free datum, of COLMAP's image points: c, k1, k2 free, as in COLMAP's RADIAL."""
    from aatri.stages.block.colmap import ColmapOptions, colmap
    from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
    from aatri.stages.interior_orientation.calibrated import calibrated

    block = colmap(options=ColmapOptions(path=into / "model", calibrate=True))
    options = BundleOptions.model_validate({"datum": "free", "blunders": "none", "standard_deviations": False})
    solution = bundle(block, image_points=calibrated(block), options=options)
    return {"same_c_px": float(solution.cameras.principal_distance_mm[0] / block.cameras.pixel_size_mm[0, 0])}


def _own_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
