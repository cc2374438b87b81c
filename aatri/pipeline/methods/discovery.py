"""Where stages come from: the built-in folder, installed packages, and a project's own `stages/`.

    built-in    ROLE/VARIANT.py under `aatri.stages`
    installed   entry points of the group `aatri.stages`, named ROLE/VARIANT (value `module:function`, or `module` that
                holds a function VARIANT) or ROLE (value `module:ROLE`, or `module` that declares ROLE)
    project     ROLE/VARIANT.py under a folder `stages/`, only where asked for: it runs the project's code

A folder is a role if its `__init__.py` assigns ROLE; otherwise its variants belong to the role of that name declared
elsewhere. Files and folders that begin with `_` or `.` are helpers. Nothing is imported here: a module is imported when
its variant is asked for. A project's folder is imported under a private package name made from its path, so that its
relative imports work and it never mixes with `aatri.stages`.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
import importlib.util
import re
import sys
import types
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from aatri.errors import PluginError

GROUP = "aatri.stages"
BUILT_IN, INSTALLED, PROJECT = "built-in", "installed", "project"

_PROJECT_PACKAGE = "aatri_project"
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_NAME_RULE = "small letters, digits and _, beginning with a letter"
_DECLARES_ROLE = re.compile(r"^ROLE\s*[:=]", re.MULTILINE)


@dataclass(frozen=True)
class Origin:
    """Where a role or variant comes from."""

    source: str
    """`built-in`, `installed` or `project`."""
    module: str
    attribute: str
    """Where it is declared. Of a project it is `aatri_project.ROLE.VARIANT`, wherever the project lies."""
    file: Path | None = None
    """The file of the module; None if it cannot be told without importing."""
    distribution: str = ""
    """Name and version of the installed package."""

    @property
    def where(self) -> str:
        """The file, or else the name of the module; with the installed package."""
        name = str(self.file or self.module)
        return f"{name} ({self.distribution})" if self.distribution else name

    @property
    def import_name(self) -> str:
        """The name to import it by; that of a project is private, and makes its package."""
        if self.source != PROJECT or self.file is None:
            return self.module
        return project_package(self.file.parents[1]) + self.module.removeprefix(_PROJECT_PACKAGE)

    def is_same(self, other: Origin) -> bool:
        """Whether both are the same declaration in the same file."""
        if self.file is None or other.file is None:
            return (self.module, self.attribute) == (other.module, other.attribute)
        return self.attribute == other.attribute and self.file.resolve() == other.file.resolve()


@dataclass(frozen=True)
class Declaration:
    """A role (`ROLE`) or variant (`ROLE/VARIANT`); a role is `declared` if its folder says so, else only used."""

    name: str
    origin: Origin
    declared: bool = True


def built_in() -> Iterator[Declaration]:
    """The stages that come with aatri."""
    package = importlib.import_module(GROUP)
    for folder in package.__path__:
        yield from _in_folder(Path(folder), GROUP, BUILT_IN)


def in_project(folder: Path) -> Iterator[Declaration]:
    """The stages in a project's own folder.

    Raises
    ------
    PluginError
        If it is not there, or a file has a name that no variant can have.
    """
    if not folder.is_dir():
        raise PluginError(
            "no such folder",
            where=str(folder),
            remedy="put your stages there as ROLE/VARIANT.py, or leave out --local-plugins",
        )
    yield from _in_folder(folder, _PROJECT_PACKAGE, PROJECT)


def installed() -> Iterator[Declaration]:
    """The stages of installed packages.

    Raises
    ------
    PluginError
        If an entry point has a name that no role or variant can have.
    """
    points = importlib.metadata.entry_points(group=GROUP)
    for point in sorted(points, key=lambda p: (p.name, p.value)):
        distribution = f"{point.dist.name} {point.dist.version}" if point.dist else ""
        parts = point.name.split("/")
        if len(parts) > 2 or not all(map(_NAME.fullmatch, parts)):
            raise PluginError(
                f"entry point {point.name!r} is not ROLE/VARIANT", where=distribution or point.value, remedy=_NAME_RULE
            )
        attribute = point.attr or ("ROLE" if len(parts) == 1 else parts[1])
        file = file_of_module(point.module)
        yield Declaration(point.name, Origin(INSTALLED, point.module, attribute, file, distribution))


def project_package(folder: Path) -> str:
    """The private name under which a project's folder of stages is imported; makes the package."""
    root = folder.resolve()
    name = f"{_PROJECT_PACKAGE}_" + hashlib.sha256(str(root).encode()).hexdigest()[:12]
    if name not in sys.modules:
        package = types.ModuleType(name, f"Stages of the project in {root}.")
        package.__path__ = [str(root)]
        sys.modules[name] = package
    importlib.invalidate_caches()
    return name


def file_of_module(module: str) -> Path | None:
    """The file of a module, found without importing it or its packages; None if that is not possible."""
    top, *rest = module.split(".")
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    file = Path(spec.origin) if spec.origin and spec.has_location else None
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    for part in rest:
        inner = [folder / part for folder in folders]
        inits = [folder / "__init__.py" for folder in inner]
        file = next((p for p in (*inits, *(folder.with_suffix(".py") for folder in inner)) if p.is_file()), None)
        folders = [folder for folder in inner if folder.is_dir()]
    return file


def _in_folder(folder: Path, package: str, source: str) -> Iterator[Declaration]:
    for role in sorted(p for p in folder.iterdir() if p.is_dir() and p.name[0] not in "_."):
        files = sorted(p for p in role.glob("*.py") if p.name[0] not in "_.")
        init = role / "__init__.py"
        if not files and not init.is_file():
            continue
        for path in (role, *files):
            if not _NAME.fullmatch(path.stem if path.is_file() else path.name):
                raise PluginError(
                    "no role or variant can have this name",
                    where=str(path),
                    remedy=f"{_NAME_RULE}; a helper begins with _",
                )
        declared = init.is_file() and bool(_DECLARES_ROLE.search(init.read_text(encoding="utf-8", errors="replace")))
        yield Declaration(role.name, Origin(source, f"{package}.{role.name}", "ROLE", init), declared)
        for path in files:
            origin = Origin(source, f"{package}.{role.name}.{path.stem}", path.stem, path)
            yield Declaration(f"{role.name}/{path.stem}", origin)
