"""Pictures of a run: shown by notebooks, saved as files."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

from aatri.report.drawing.picture import Picture


@dataclass(frozen=True)
class Plots:
    """Pictures of a run's report by name."""

    pictures: Mapping[str, Picture]
    """Each its marks as arrays in the units of its axes, its title and caption."""

    def save(self, folder: str | Path = ".", form: str = "svg") -> list[Path]:
        """Write each as NAME.svg, NAME.png or NAME.pdf, drawn by matplotlib.

        Raises
        ------
        InputError, SpecError
            If matplotlib is not installed, or there is no such format.
        """
        from aatri.formats.text.written_files import write_files
        from aatri.report.plotting import file_name, plotted

        files = {file_name(picture, form): plotted(picture, form) for picture in self.pictures.values()}
        write_files(Path(folder), files)
        return [Path(folder, name) for name in files]

    def __repr__(self) -> str:
        return "\n".join(f"{name}: {picture.title}" for name, picture in self.pictures.items())

    def _repr_html_(self) -> str:
        return "".join(map(_figure, self.pictures.values()))


def _figure(picture: Picture) -> str:
    """An image whose colours and rules bear on nothing else in the notebook."""
    from aatri.report.drawing.standalone import standalone

    drawn = base64.b64encode(standalone(picture).encode()).decode()
    image = f'<img src="data:image/svg+xml;base64,{drawn}" alt="{escape(picture.title)}" style="max-width: 100%">'
    return f"<figure>{image}<figcaption>{escape(picture.caption)}</figcaption></figure>"
