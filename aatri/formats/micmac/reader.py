"""Reading of files of MicMac: an orientation folder, files of measured and of ground points, or a project with all."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aatri.codes import CONTROL
from aatri.errors import InputError
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.poses import ground_from_image
from aatri.formats.micmac.dialects import add_mmvii, add_v1
from aatri.formats.micmac.project import MicmacProject
from aatri.formats.micmac.writer import write_micmac
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading, all_files
from aatri.formats.text.text_file import missing
from aatri.formats.text.text_line import places
from aatri.formats.text.xml_tree import read_xml
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

ROOTS = ("ExportAPERO", "DicoAppuisFlottant", "SetOfMesureAppuisFlottants", "Global", "Root")

FolderFiles = tuple[Path, list[Path]]

MOST_LEVELS = 3
"""Folders within folders in which orientations and measurements of a project lie."""


def read_micmac(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a file or folder of MicMac.

    Parameters
    ----------
    path : Path
        A file; or a folder with the files; or a project, whose folders of orientations and of measured points are
        one each.

    Raises
    ------
    InputError
        If a file is not of its form, or the files contradict each other.
    """
    project = read_project(path, reporter)
    images, files = project.images, project.files
    names = list(dict.fromkeys([*(image.name for image in images), *(mark.image for mark in project.marks)]))
    camera = {image.name: image.camera for image in images}
    parts = BlockParts(
        "micmac",
        files,
        name=path.resolve().stem,
        **camera_parts(list(project.cameras.values()), reporter, allowed_px=reading.lens_misfit_px),
    )
    if names:
        parts.images = {"id": names, "camera": [camera.get(name, "") for name in names]}
    if images:
        parts.notes.append("orientations are taken to be in the frame of the ground points (GCPBascule, Campari)")
        parts.exterior = {
            "image": [image.name for image in images],
            "position_m": [image.centre_m for image in images],
            "ground_from_image": ground_from_image(np.array([image.axes for image in images]), "micmac"),
            **places([image.at for image in images], files),
        }
    if project.marks:
        covariance = np.array([mark.covariance_px2 for mark in project.marks])
        if (covariance[:, 0, 1] != 0).any() and np.isfinite(covariance[:, 0, 1]).any():
            parts.notes.append("covariances between x and y of image points are left out: they count as independent")
        parts.image_points = {
            "image": [mark.image for mark in project.marks],
            "point": [mark.point for mark in project.marks],
            "xy": [mark.xy_px for mark in project.marks],
            "sigma_px": np.sqrt(np.einsum("nii->ni", covariance)),
            **places([mark.at for mark in project.marks], files),
        }
    if project.targets:
        parts.ground_points = {
            "point": [target.point for target in project.targets],
            "xyz_m": [target.xyz_m for target in project.targets],
            "covariance_m2": [target.covariance_m2 for target in project.targets],
            "role": CONTROL,
            **places([target.at for target in project.targets], files),
        }
    return parts


def read_project(path: Path, reporter: Reporter = SILENT) -> MicmacProject:
    """What the files of a file, folder or project give.

    Raises
    ------
    InputError
        As `read_micmac`.
    """
    project, others = MicmacProject(), []
    for file in _files(path):
        root = read_xml(file, ROOTS, "an orientation, calibration or point file of MicMac")
        project.files.append(file)
        if not (add_mmvii if root.tag == "Root" else add_v1)(project, root):
            others.append(project.files.pop().name)
    others += [f"{error.where} ({error.what})" for error in project.without_like.values()]
    if others:
        reporter.log(f"{path}: not read: {shown(others)}")
    if not project.files:
        raise InputError("no file of MicMac", where=str(path), remedy="name the folder with the orientations")
    project.check()
    return project


def _files(path: Path) -> list[Path]:
    """The XML files of a folder, or of a project, in the order of their names."""
    if not path.is_dir():
        return [path]
    of_orientations, of_points = folders_of_project(path)
    for what, several in (("orientations", of_orientations), ("measured points", of_points)):
        if len(several) > 1:
            names = shown([str(folder.relative_to(path)) for folder, _ in several])
            remedy = (
                f"give one of them and the files with marks and ground points: --from {several[0][0]} --from FILE ..."
            )
            raise InputError(f"several folders with {what}: {names}", where=str(path), remedy=remedy)
    return [*_xml_of(path), *(file for _, files in (*of_orientations, *of_points) for file in files)] or _none(path)


def folders_of_project(path: Path) -> tuple[list[FolderFiles], list[FolderFiles]]:
    """Folders of a project with orientations, and with measured points, each with its files.

    None where orientations lie in the folder itself: then it is no project.
    """
    if any(_has_orientations(file) for file in _xml_of(path)):
        return [], []
    within = [folder for level in range(1, MOST_LEVELS + 1) for folder in sorted(path.glob("/".join("*" * level)))]
    folders = [(folder, _xml_of(folder)) for folder in within if folder.is_dir() and not folder.is_symlink()]
    of_orientations = [(folder, files) for folder, files in folders if any(map(_has_orientations, files))]
    of_points = [(folder, files) for folder, files in folders if any(map(_has_points, files))]
    return of_orientations, of_points


def _none(path: Path) -> list[Path]:
    if not path.exists():
        raise missing(path)
    raise InputError("no XML file of MicMac", where=str(path), remedy="name the folder with the orientations")


def _xml_of(folder: Path) -> list[Path]:
    """Files of MicMac in a folder, with those whose names say that they are and whose content does not."""
    files = sorted(folder.glob("*.xml"))
    return [file for file in files if _contains(file, ROOTS) or file.name.startswith(("Orientation-", "AutoCal"))]


def _has_orientations(file: Path) -> bool:
    return _contains(file, ("<OrientationConique", "<CameraPose"))


def _has_points(file: Path) -> bool:
    return _contains(file, ("<SetMesIm", "<SetGCP", "<SetOfMesureAppuisFlottants", "<DicoAppuisFlottant"))


def _contains(file: Path, words: Sequence[str]) -> bool:
    """Whether the beginning of a file has one of some words."""
    try:
        with file.open("rb") as opened:
            head = opened.read(4096).decode("utf-8", errors="replace")
    except OSError:
        return False
    return any(word in head for word in words)


LOOKED_FOR = "XML with `ExportAPERO`, `MMVII_Serialization`, `DicoAppuisFlottant` or `SetOfMesureAppuisFlottants`"
WORDS = ("<ExportAPERO", "MMVII_Serialization", "<DicoAppuisFlottant", "<SetOfMesureAppuisFlottants")


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return next((f"XML with {word.strip('<')}" for word in WORDS if word in view.head), "")
    xml = [name for name in view.names if name.lower().endswith(".xml")]
    seen = next((name for name in xml if _recognised(view.of(name))), "")
    folders = [name for name in view.names if name.startswith("Ori-") or name == "MMVII-PhgrProj"]
    return f"{seen}, {_recognised(view.of(seen))}" if seen else ", ".join(folders)


def _holds_several(view: FileView) -> bool:
    return view.is_folder and any(len(folders) > 1 for folders in folders_of_project(view.path))


MICMAC = Format(
    "micmac", "MicMac and MMVII", _recognised, LOOKED_FOR,
    carries=("cameras", "distortion", "image points", "control", "standard deviations", "covariances",
             "start orientations"),
    page="docs/formats.md#micmac", read=read_micmac, files_of=all_files, write=write_micmac,
    written=("cameras", "distortion", "image points", "control", "standard deviations", "start orientations"),
    estimates_cameras=True, holds_several=_holds_several,
)  # fmt: skip
