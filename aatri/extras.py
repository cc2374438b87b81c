"""Libraries that not every user needs: imported where they are used, and told by name where they are missing."""

import importlib
from typing import Any

from aatri.errors import ResourceError


def of_extra(module: str, extra: str) -> Any:
    """A module of an extra of the package.

    Raises
    ------
    ResourceError
        If it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        what = f"{module.partition('.')[0]} is not installed, which works on images need"
        raise ResourceError(what, remedy=f'pip install "aatri[{extra}]"') from error
