"""What Pix4D's parameters are recognised by, and what they carry."""

from aatri.formats.parts.format import FileView, Format, all_files
from aatri.formats.pix4d.reader import ENDING, HEAD, read_pix4d


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return f"a first line {HEAD}" if view.head.startswith(HEAD) else ""
    return next((name for name in view.names if name.endswith(ENDING) and _recognised(view.of(name))), "")


PIX4D = Format(
    "pix4d",
    "Pix4D parameters",
    _recognised,
    "`*_calibrated_camera_parameters.txt`",
    carries=("cameras", "distortion", "start orientations"),
    page="docs/formats.md#pix4d-parameters",
    read=read_pix4d,
    files_of=all_files,
    estimates_cameras=True,
)
