"""What files of MicMac are recognised by, and what they carry."""

from aatri.formats.micmac.reader import folders_of_project, read_micmac
from aatri.formats.micmac.writer import write_micmac
from aatri.formats.parts.format import FileView, Format, all_files

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
