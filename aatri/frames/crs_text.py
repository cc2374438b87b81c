"""A coordinate reference system from a text, without letting PROJ open files of the text's choosing.

PROJ reads grids (`+nadgrids=`, `+geoidgrids=`, `+grids=` ..., PARAMETERFILE of WKT, file parameters of PROJJSON) and
initialisation files (`+init=`). Names of grids are looked up where PROJ has its own; a path could be any file, so it is
refused wherever it stands.
"""

import json
import re
import warnings
from collections.abc import Iterator
from typing import Any

from aatri.ids import clipped

_NAME = re.compile(r"@?[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
_INIT = re.compile(r"(epsg|esri|EPSG|ESRI):[0-9]{1,7}")
_PROJ_VALUE = re.compile(r"(?:^|[\s+])([A-Za-z_0-9]+)\s*=\s*(\"[^\"]*\"|[^\s\",\]]+(?:,[^\s\",\]]+)*)")
_OF_FILES = re.compile(r"grids$|^(init|file|model|catalog|coords|coefficients)$")
_WKT_FILE = re.compile(r"PARAMETERFILE\s*[\[(]\s*\"[^\"]*\"\s*,\s*\"([^\"]*)\"", re.IGNORECASE)
_LIKE_A_PATH = re.compile(r"[/\\~].*:|^[./~\\]|:\\")
_URI = re.compile(r"(urn:ogc:def:|https?://(www\.)?opengis\.net/)[A-Za-z0-9:/._,-]*")


def crs_from(text: str) -> Any:
    """The CRS of pyproj that a text names.

    Raises
    ------
    pyproj.exceptions.CRSError
        If it names none, or a file by its path.
    """
    import pyproj

    for name in _files(text):
        if not _NAME.fullmatch(name):
            raise pyproj.exceptions.CRSError(f"it names the file {clipped(name)!r}: grids are named without a path")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # +init=epsg:... is old, and as good
        return pyproj.CRS.from_user_input(text)


def _files(text: str) -> Iterator[str]:
    """What a text makes PROJ look for as files."""
    yield from _WKT_FILE.findall(text)
    for key, value in _PROJ_VALUE.findall(text) if "=" in text else ():
        if key.lower() == "init":
            yield value if not _INIT.fullmatch(value) else "epsg"
        elif _OF_FILES.search(key.lower()):
            yield from value.strip('"').split(",")
    if text.lstrip().startswith("{"):
        try:
            yield from _of_json(json.loads(text))
        except (ValueError, RecursionError):
            yield "/"  # no JSON: pyproj is not asked
    elif _LIKE_A_PATH.search(text) and not re.search(r'[+\["=]', text) and not _URI.fullmatch(text.strip()):
        yield text


def _of_json(value: Any) -> Iterator[str]:
    """Texts that PROJJSON gives as values of parameters, and PROJ texts within it."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if isinstance(inner, str):
                yield from [inner] if key == "value" else _files(inner) if "=" in inner else ()
            else:
                yield from _of_json(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _of_json(inner)
