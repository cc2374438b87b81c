"""A stage of one's own to start from: it keeps its contract, doing what a built-in variant of its role does."""

from __future__ import annotations

import keyword
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.errors import SpecError

if TYPE_CHECKING:
    from aatri.plugin import Role, StageCard

_STAGE = '''\
"""{Role} by a method of your own: one sentence.

Here go the equation with its symbols, and the source. For now it does what {start} does.
"""

{imports}


class {Name}Options(Options):
    """Options of {use}."""

    example: float = Field(1.0, gt=0, description="an example: replace it by options of your own, with their units")


@stage(version=1, uses={uses})
def {name}(
    {parameters}
) -> {kind}:
    """{Role}, my way."""
    context.log(f"example is {{options.example}}")
    {call}
'''
_TEST = """\
from pathlib import Path

from aatri.testing.check import check_stage


def test_{name}_keeps_its_contract():
    check_stage("{use}", local=Path(__file__).parents[1] / "stages")
"""


def plugin_files(use: str, folder: Path) -> dict[Path, str]:
    """The files of a new stage and its test, by path.

    Raises
    ------
    SpecError
        If the name is not ROLE/NAME, or a stage of that name is there.
    PluginError
        If there is no such role.
    """
    from aatri.cli.new_block import demo_path
    from aatri.cli.new_from_text import PHOTOS
    from aatri.pipeline.methods.registry import find_stages
    from aatri.pipeline.spec.pipeline_file import USE

    if not USE.fullmatch(use) or keyword.iskeyword(use.rpartition("/")[2]):
        raise SpecError(
            f"{use!r} is not ROLE/NAME",
            where="--plugin",
            remedy="small letters, digits and _, beginning with a letter; see `aatri stages`",
        )
    registry = find_stages()
    role, _, name = use.partition("/")
    declared = registry.role(role)
    if use in registry.variants:
        raise SpecError(
            f"there is a stage {use} already: {registry.origins[use].where}",
            where="--plugin",
            remedy="choose another name",
        )
    cards = [registry.card(variant) for variant in registry.variants_of(role)]
    usual = demo_path().read_text(encoding="utf-8") + PHOTOS
    # what others of the chain are made to go with comes first, what wants data of its own last
    cards.sort(key=lambda card: (f"use: {card.name}," not in usual, bool(card.needs)))
    start = next((card for card in cards if not _needs_options(card)), None)
    return {
        folder / "stages" / role / f"{name}.py": _stage_text(use, declared, start),
        folder / "tests" / f"test_{name}.py": _TEST.format(name=name, use=use),
    }


def _needs_options(card: StageCard) -> bool:
    return card.options is not None and any(field.is_required() for field in card.options.model_fields.values())


def _stage_text(use: str, declared: Role, start: StageCard | None) -> str:
    role, _, name = use.partition("/")
    camel = "".join(word.capitalize() for word in name.split("_"))
    ports = [
        f"{port}: {kind.__name__}{' | None = None' * may_lack}" for port, kind, may_lack in _ports(declared, start)
    ]
    extras = [f"options: {camel}Options = {camel}Options()"]
    extras += ["rng: np.random.Generator"] if start and start.wants_rng else []
    extras.append("context: Context = SILENT")
    if start is not None:
        handed = [port.name for port in start.ports]
        handed += [
            f"{extra}={extra}"
            for extra, is_used in (("rng", start.wants_rng), ("context", start.wants_context))
            if is_used
        ]
        call = f"return {start.variant}({', '.join(handed)})"
    else:
        call = 'raise NotImplementedError("your method")'
    return _STAGE.format(
        Role=role.replace("_", " ").capitalize(),
        Name=camel,
        name=name,
        use=use,
        start=start.name if start else "nothing",
        kind=declared.kind.__name__,
        uses=_uses(start),
        imports=_imports(declared, start),
        parameters=",\n    ".join([*ports, "*", *extras]) + ",",
        call=call,
    )


def _ports(declared: Role, start: StageCard | None) -> list[tuple[str, type[Any], bool]]:
    """Name, kind, and whether it may be absent, of the ports of the variant it starts from; else those of the role."""
    if start is None:
        return [(port, kind, False) for port, kind in declared.ports.items()]
    return [(port.name, port.kind, port.optional) for port in start.ports]


def _uses(start: StageCard | None) -> str:
    """What the built-in variant uses with its defaults, as it is written."""
    names = (start.used_with(start.options() if start.options else None) if start else None) or ()
    lines = "".join(f'    "{name}",\n' for name in names)
    return f"(\n{lines})" if names else "()"


def _imports(declared: Role, start: StageCard | None) -> str:
    kinds = {*(kind for _, kind, _ in _ports(declared, start)), declared.kind}
    lines = {f"from {kind.__module__} import {kind.__name__}" for kind in kinds}
    lines.add("from aatri.plugin import SILENT, Context, Field, Options, stage")
    if start is not None:
        lines.add(f"from {start.function.__module__} import {start.function.__name__}")
    numpy = "import numpy as np\n\n" if start is not None and start.wants_rng else ""
    return numpy + "\n".join(sorted(lines, key=lambda line: line.partition(" import ")[0]))
