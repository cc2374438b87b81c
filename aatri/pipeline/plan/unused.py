"""What a result offers and no stage of the pipeline uses, or one needs and it does not offer: an error, at once.

A stage that takes the result states by name what it uses of it. An offer counts as used if one stage of the pipeline
uses it; which of them are selected to run does not matter. What a stage takes of the kind that it makes itself it hands
on: its own result offers it again. An offer is left alone where the pipeline makes nothing that it
bears upon: control points in a pipeline that ends with models. Unused groupings and checks, and what pipeline.yaml
names under `ignore`, are warnings; so is everything where a stage does not state what it uses. Of what several stages
need the first is told.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from aatri.errors import AatriError, GeometryError, InputError
from aatri.pipeline.plan.graph import StageNode, downstream
from aatri.tables.offers import Need, Offer, covers, offer_from_plain

MILD = ("check", "grouping", "reduction")
"""Natures that are told and do not stop a run: what a frame asks for may be left out knowingly."""


@dataclass(frozen=True)
class Unused:
    """What is to be said of the results of some stages."""

    errors: tuple[AatriError, ...] = ()
    warnings: tuple[tuple[str, str], ...] = ()
    """Stage and message."""


def unused(
    nodes: tuple[StageNode, ...], records: Iterable[Mapping[str, Any]], ignore: tuple[str, ...], of: str = ""
) -> Unused:
    """Compare what results offer with what the stages of the pipeline use.

    Parameters
    ----------
    nodes : tuple of StageNode
        The whole pipeline.
    records : iterable of dict
        Records of results.
    ignore : tuple of str
        Names, or tables, that may be left unused.
    of : str
        Only of what this stage takes, where it is given.
    """
    errors: list[AatriError] = []
    warnings: list[tuple[str, str]] = []
    for record in records:
        source = str(record["stage"])
        takers = [node for node in nodes if source in node.inputs.values()]
        if not takers or (of and of not in {node.name for node in takers}):
            continue
        below = set(downstream(nodes, source))
        kinds = {node.method.kind for node in nodes if node.name in below}
        used = {name for node in takers for name in node.uses or ()}
        silent = sorted({node.method.name for node in takers if node.uses is None})
        offers = [offer_from_plain(plain) for plain in record.get("offers") or ()]
        if any(node.method.kind == record.get("output", {}).get("kind") for node in takers):
            continue
        if sum(node.method.kind == record.get("output", {}).get("kind") for node in nodes) == 1:
            unmatched = [name for name in ignore if not any(covers(name, o.name) for o in offers)]
            remedy = "there is nothing of that name to ignore; take it out, or mend the name"
            warnings += [(source, f"pipeline.yaml, ignore: {name}: {remedy}") for name in unmatched]
        if record.get("offers") is not None:
            errors += _missing(takers, source, {offer.name: offer.what for offer in offers})[:1]
        for offer in offers:
            if offer.name in used or offer.bears_on not in kinds:
                continue
            ignored = any(covers(name, offer.name) for name in ignore)
            if offer.nature in MILD or ignored or silent:
                warnings.append((source, _warning(offer, ignored, silent)))
            else:
                errors.append(_error(offer))
    return Unused(tuple(errors), tuple(warnings))


def _missing(takers: list[StageNode], source: str, offered: Mapping[str, str]) -> list[GeometryError]:
    """What stages need of a result that does not offer it, with what it offers of that, in words by name."""
    return [
        GeometryError(
            f"{need.what}, without which the stage cannot work{_too_little(need, offered)}",
            where=f"pipeline.yaml, stage {node.name}",
            remedy=need.remedy,
        )
        for node in takers
        for need in node.needs
        if node.inputs.get(need.port) == source
        and offered.keys().isdisjoint(need.one_of)
        and need.or_port not in node.inputs
    ]


def _too_little(need: Need, offered: Mapping[str, str]) -> str:
    """Of `table.column:kind` that is needed the `table.column` that is there."""
    there = [offered[part] for name in need.one_of if (part := name.partition(":")[0]) in offered]
    return f": it has {' and '.join(there)}" if there else ""


def _error(offer: Offer) -> InputError:
    return InputError(
        f"{offer.what}: not used by any stage of this pipeline, without effect",
        where=offer.where,
        remedy=f"add or set a stage that uses {offer.name} (`aatri stages ROLE/VARIANT` says what each uses); or take "
        f"it out of the block; or go on without it by `ignore: [{_quoted(offer.name)}]` at the top of "
        "pipeline.yaml",
    )


def _warning(offer: Offer, ignored: bool, silent: list[str]) -> str:
    prefix = f"{offer.where}: " if offer.where else ""
    reason = "not used by any stage of this pipeline"
    if ignored:
        reason = f"without effect, as pipeline.yaml says by ignore: {offer.name}"
    elif silent and offer.nature not in MILD:
        reason = f"no stage says that it uses it ({', '.join(silent)} states nothing)"
    return f"{prefix}{offer.what}: {reason}"


def _quoted(name: str) -> str:
    """As YAML takes it within brackets."""
    return f'"{name}"' if ":" in name else name
