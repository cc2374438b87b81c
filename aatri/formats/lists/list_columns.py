"""What the columns of a list are: by name in its header, by a preset, or as the user says.

A column is one of `WORDS`; `-` is one that is not read, `?` after a word one that a row may lack at its end, `-` before
an angle turns its sign. X is east or longitude, whatever the order of the columns.

    image X Y Z omega phi kappa     - image time longitude latitude Z     point X Y Z sX sY sZ role     image point x y

Headers are matched without case, unit in brackets and remark sign. A column called `name`, `label` or `id` is of images
where there are angles or its names end as image files do, else of points. `x` and `y` of a list of images and points
without heights are image coordinates, in pixels, or in millimetres (`x_mm`, `x [mm]`) from the image centre, y up.

Sources: ArcGIS Reality documentation, coordinate system conventions (omega-phi-kappa, UltraMap's y, x, z); manuals of
the programs named on the page of formats.
"""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from aatri.codes import CHECK, CONTROL, NO_ROLE
from aatri.errors import SpecError
from aatri.formats.conventions.names import without_extension
from aatri.ids import did_you_mean

ANGLES = {
    "omega-phi-kappa": ("omega", "phi", "kappa"),
    "phi-omega-kappa": ("phi", "omega", "kappa"),
    "yaw-pitch-roll": ("yaw", "pitch", "roll"),
}
"""Names of the columns of each system."""

ROTATION = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))

SAME = {
    "image": "photo file foto bild frame picture",
    "point": "gcp marker target pt station controlpoint punkt pkt punto",
    "name": "label event nom nr id",
    "camera": "sensor",
    "time": "times gpstime timestamp gpsseconds",
    "X": "x e east easting xeasting xeast rechts rechtswert ost est este x0 xgps gcpmeasuredx",
    "Y": "y n north northing ynorthing ynorth hoch hochwert nord norte y0 ygps gcpmeasuredy",
    "Z": "z h height altitude alt elevation elev up hohe hoehe cota quota zaltitude ellipsoidheight "
    "ellipsoidalheight orthometricheight z0 zgps gcpmeasuredz",
    "longitude": "lon long lng xlongitude",
    "latitude": "lat ylatitude",
    "omega": "o w",
    "phi": "p",
    "kappa": "k",
    "yaw": "heading",
    "pitch": "",
    "roll": "",
    "x": "col column xpx pixelx imx imagex sample u",
    "y": "row line ypx pixely imy imagey v",
    "sXY": "sxy hacc",
    "sX": "",
    "sY": "",
    "sZ": "vacc",
    "sx": "",
    "sy": "",
    **{f"s{angle}": "" for angle in ("omega", "phi", "kappa", "yaw", "pitch", "roll")},
    **{name: name.replace("r", "m") for name in ROTATION},
    "role": "category",
}
"""Words of columns, and what they are called in headers, in small letters, without blanks, signs and accents."""

DEVIATION = r"standarddeviation|stddev|stdev|std|sigma|accuracy|acc"
OF_DEVIATION = re.compile(rf"(?:{DEVIATION}|s)(?P<after>.+)|(?P<before>.+?)(?:{DEVIATION})")
"""What is the standard deviation of another column."""

PLAN, HEIGHT = ("xy", "hor", "horizontal"), ("ver", "vertical", "u")
"""Of standard deviations: words for X and Y together, and for Z."""

OF_ROLE = ("type", "code", "kind", "class")
"""A column that is called so has roles, if the first row has one."""

ROLES = {
    **dict.fromkeys(("control", "gcp", "full"), CONTROL),
    **dict.fromkeys(("check", "checkpoint"), CHECK),
    **dict.fromkeys(("", "none", "tie"), NO_ROLE),
}

WORDS = [word for word in SAME if word != "name"]


IN_IMAGE = re.compile(r"(s?[xy])_(px|mm|um)(\??)")
"""Image coordinates and their standard deviations, with their unit."""


class ListColumns(NamedTuple):
    """The columns of a list in their order; unit and system of its angles, None where they do not say."""

    words: tuple[str, ...]
    angle: str | None = None
    rotation: str | None = None
    in_image: Mapping[str, str] = MappingProxyType({})
    """Units of x, y, sx and sy where they are said: px, mm or um."""

    @property
    def names(self) -> tuple[str, ...]:
        """The words without their signs."""
        return tuple(re.sub(r"^-(?=[a-zA-Z])|\?$", "", word) for word in self.words)

    @property
    def fewest(self) -> int:
        """Columns that a row must have."""
        return max(k for k, word in enumerate(self.words, 1) if not word.endswith("?"))

    @property
    def system(self) -> str | None:
        """The system of the angles, by their order if nothing else says; None without angles."""
        own = [name for name in self.names if name in ("omega", "phi", "kappa", "yaw", "pitch", "roll")]
        if len(own) != 3 or {"phi", "pitch"}.isdisjoint(own):
            return None
        by_order = "phi-omega-kappa" if own[0] == "phi" else "omega-phi-kappa"
        return "yaw-pitch-roll" if "yaw" in own else self.rotation or by_order


class ListPreset(NamedTuple):
    """A program's list of orientations: its columns, what separates them, and the lines before."""

    columns: ListColumns
    separator: str
    header: str = ""


def _preset(columns: str, separator: str, header: str = "", rotation: str = "omega-phi-kappa") -> ListPreset:
    return ListPreset(ListColumns(tuple(columns.split()), "deg", rotation), separator, header)


PRESETS = {
    "metashape": _preset(
        f"image X Y Z omega phi kappa {' '.join(ROTATION)}",
        "\t",
        f"# Cameras ({{n}})\n# PhotoID, X, Y, Z, Omega, Phi, Kappa, {', '.join(ROTATION)}",
    ),
    "pix4d": _preset("image X Y Z omega phi kappa", " ", "imageName X Y Z Omega Phi Kappa"),
    "ign": _preset("image X Y Z omega phi kappa camera?", "\t", "NOM\tX\tY\tZ\tO\tP\tK\tCAMERA"),
    "erdas": _preset("- image X Y Z omega phi kappa", " "),
    "contextcapture": _preset("image X Y Z omega phi kappa", ";", "Name;X;Y;Z;Omega;Phi;Kappa"),
    "applanix": _preset(
        "image - time X Y Z omega phi kappa -? -?",
        "\t",
        "(position in Meters, orientation in Degrees, lat, long in Deg)\n"
        "ID\tEVENT\tTIME(s)\tEASTING\tNORTHING\tELLIPSOID HEIGHT\tOMEGA\tPHI\tKAPPA",
    ),
    "ultramap": _preset("image X Y Z omega -phi kappa", " ", "image X Y Z omega phi kappa", "phi-omega-kappa"),
}
"""Lists of orientations by program; angles in degrees."""


def columns_named(text: str) -> ListColumns:
    """The columns of a preset, or of words in their order.

    Raises
    ------
    SpecError
        If a word is no column.
    """
    if text in PRESETS:
        return PRESETS[text].columns
    stated = re.split(r"[\s,;]+", text.strip())
    units = {part[1]: part[2] for word in stated if (part := IN_IMAGE.fullmatch(word))}
    columns = ListColumns(tuple(IN_IMAGE.sub(r"\1\3", word) for word in stated), in_image=units)
    for word, name in zip(columns.words, columns.names):
        if name != "-" and name not in WORDS:
            what = f"columns: {word!r} is no column and no preset{did_you_mean(name, [*WORDS, *PRESETS])}"
            raise SpecError(what, remedy=f"columns are {', '.join(WORDS)}, and -; presets {', '.join(PRESETS)}")
    fault = _fault(columns)
    if "um" in (units.get("x"), units.get("y")):
        fault = "image coordinates in um; give them in px or in mm"
    if fault:
        raise SpecError(f"columns: {fault}", remedy="`image X Y Z omega phi kappa`, `point X Y Z`, `image point x y`")
    return columns


def columns_of_header(cells: Sequence[str], first_row: Sequence[str]) -> ListColumns | None:
    """The columns that a header proposes; None if it is none."""
    names, angle = list[str](), None
    for cell in cells:
        unit = re.search(r"[(\[](deg|gon|grad|rad)[a-z]*[)\]]", cell.lower())
        angle = {"grad": "gon"}.get(unit.group(1), unit.group(1)) if unit else angle
        of_role = cell.strip("# \"'").lower() in OF_ROLE and first_row[len(names) : len(names) + 1]
        names.append("role" if of_role and of_role[0] and of_role[0].casefold() in ROLES else _word(cell))
    if "name" in names:
        at = names.index("name")
        if not {"image", "point"} & {*names}:
            name = first_row[at] if at < len(first_row) else ""
            of_images = without_extension(name) != name or {"omega", "yaw"} & {*names}
            names[at] = "image" if of_images else "point"
        names = ["-" if word == "name" else word for word in names]
    measured = {"image", "point"} <= {*names} and "Z" not in names
    if measured and not {"x", "y"} & {*names}:
        names = [{"X": "x", "Y": "y", "sX": "sx", "sY": "sy"}.get(name, name) for name in names]
    elif not measured and not {"X", "Y"} & {*names}:
        names = [{"x": "X", "y": "Y", "sx": "sX", "sy": "sY"}.get(name, name) for name in names]
    if {"X", "Y"} <= {*names}:
        names = ["-" if name in ("longitude", "latitude") else name for name in names]
    columns = ListColumns(tuple(names), angle)
    return None if _fault(columns) else columns


def _word(cell: str) -> str:
    """The word of a column by its name in a header; `-` if it is none."""
    text = re.sub(r"[(\[][^)\]]*[)\]]", "", cell.lstrip("#")).strip(" \t\"'")
    if text in WORDS:
        return text
    if part := IN_IMAGE.fullmatch(text.lower()):
        return part[1]
    plain = unicodedata.normalize("NFKD", text.lower()).encode("ascii", "ignore").decode()
    short = re.sub(r"[^a-z0-9]", "", plain)
    word = _called(short)
    deviation = OF_DEVIATION.fullmatch(short)
    if word == "-" and deviation:
        quantity = deviation["after"] or deviation["before"]
        word = "sXY" if quantity in PLAN else "sZ" if quantity in HEIGHT else f"s{_called(quantity)}"
    return word if word in SAME else "-"


def _called(short: str) -> str:
    """The word that is called so: as it stands, else without `gps` before it or what makes a name or number of it."""
    part = re.fullmatch(r"(?:gps)?(.+?)(?:name|nummer|number|nr|no|id|label)?", short)
    names = [short, part[1]] if part else [short]
    return next(
        (word for name in names for word, others in SAME.items() if name in (word.lower(), *others.split())), "-"
    )


def _fault(columns: ListColumns) -> str:
    """Why these columns are no list; empty if they are one."""
    names = {*columns.names}
    twice = {name for name in names - {"-"} if columns.names.count(name) > 1}
    place = {"X", "Y"} <= names or {"longitude", "latitude"} <= names
    if twice:
        return f"{', '.join(sorted(twice))} twice"
    if not {"image", "point"} & names:
        return "neither `image` nor `point`"
    if {"x", "y"} & names and not {"image", "point", "x", "y"} <= names:
        return "image coordinates need `image point x y`"
    if {"image", "point"} <= names and "x" not in names:
        return "`image` and `point` without `x y`"
    if cut := next((system for system in ANGLES.values() if len({*system} & names) == 2), None):
        return f"of the angles {', '.join(cut)} two"
    if not ({"x", "y"} <= names or place or columns.system):
        return "neither `X Y Z` nor three angles nor `x y`"
    return ""
