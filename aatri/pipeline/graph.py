"""Wiring: stages with their plugins, ports and options, checked before anything runs, in the order of execution.

Plugins exist and keep to their role; every name under `from` is a port of the role and its source a stage of the right
kind; required ports are there; options are valid; there is no cycle. All errors are reported at once.
"""

from __future__ import annotations

import graphlib
from collections.abc import Mapping
from dataclasses import dataclass

from aatri.errors import AatriError, PluginError, SpecError, raise_all
from aatri.ids import did_you_mean
from aatri.pipeline.options import validated
from aatri.pipeline.registry import Registry
from aatri.pipeline.spec import Spec, StageSpec
from aatri.plugin import Options, Role, StageCard


@dataclass(frozen=True)
class Node:
    """A stage ready to run: `inputs` holds only the ports that its variant uses, port -> stage."""

    name: str
    card: StageCard
    inputs: Mapping[str, str]
    options: Options | None


def wire(spec: Spec, registry: Registry) -> tuple[Node, ...]:
    """The stages in the order of execution; among those ready at once, in the order of the file.

    Raises
    ------
    AatriError
        Every wrong wire and option (SpecError) and plugin (PluginError), at once.
    """
    errors: list[AatriError] = []
    roles = _roles(spec, registry, errors)
    cards = _cards(spec, registry, roles, errors)
    nodes = {}
    for name, stage in spec.stages.items():
        if name not in roles:
            continue
        _check_inputs(spec, stage, roles, errors)
        if name in cards:
            _check_required(spec, stage, cards[name], roles, errors)
            options = validated(spec, stage, cards[name], errors)
            used = {p.name: stage.inputs[p.name] for p in cards[name].ports if p.name in stage.inputs}
            nodes[name] = Node(name, cards[name], used, options)
    order = _order(spec, errors)
    raise_all(errors)
    return tuple(nodes[name] for name in order)


def downstream(nodes: tuple[Node, ...], name: str) -> tuple[str, ...]:
    """The stages that use a stage, directly or not, in order."""
    reached = {name}
    for node in nodes:
        if reached & set(node.inputs.values()):
            reached.add(node.name)
    return tuple(node.name for node in nodes if node.name in reached and node.name != name)


def _roles(spec: Spec, registry: Registry, errors: list[AatriError]) -> dict[str, Role]:
    roles = {}
    for name, stage in spec.stages.items():
        try:
            roles[name] = registry.role(stage.use.partition("/")[0])
        except PluginError as error:
            errors.append(_placed(error, spec.where(name, "use")))
    return roles


def _cards(spec: Spec, registry: Registry, roles: Mapping[str, Role], errors: list[AatriError]) -> dict[str, StageCard]:
    cards = {}
    for name, stage in spec.stages.items():
        if name in roles:
            try:
                cards[name] = registry.card(stage.use)
            except PluginError as error:
                errors.append(_placed(error, spec.where(name, "use")))
    return cards


def _placed(error: PluginError, where: str) -> PluginError:
    what = f"{error.where}: {error.what}" if error.where else error.what
    return PluginError(what, where=where, remedy=error.remedy)


def _check_inputs(spec: Spec, stage: StageSpec, roles: Mapping[str, Role], errors: list[AatriError]) -> None:
    ports = roles[stage.name].ports
    role = stage.use.partition("/")[0]
    for port, source in stage.inputs.items():
        if port not in ports:
            hint = did_you_mean(port, ports) or f"; it has {', '.join(ports) or 'none'}"
            errors.append(SpecError(f"{role} has no port {port!r}{hint}",
                                    where=spec.where_key(stage.name, "from", port)))  # fmt: skip
        elif source not in spec.stages:
            errors.append(SpecError(f"no stage {source!r}{did_you_mean(source, spec.stages)}",
                                    where=spec.where(stage.name, "from", port),
                                    remedy=_candidates(spec, port, ports, roles)))  # fmt: skip
        elif source in roles and roles[source].kind is not ports[port]:
            wanted, given = ports[port].kind, roles[source].kind.kind
            errors.append(SpecError(f"{stage.name}.{port} wants a {wanted}, but {source} gives {given}",
                                    where=spec.where(stage.name, "from", port),
                                    remedy=_candidates(spec, port, ports, roles)))  # fmt: skip


def _check_required(
    spec: Spec, stage: StageSpec, card: StageCard, roles: Mapping[str, Role], errors: list[AatriError]
) -> None:
    for port in card.ports:
        if not port.optional and port.name not in stage.inputs:
            errors.append(SpecError(f"{stage.name} ({card.name}) needs port {port.name} ({port.kind.kind})",
                                    where=spec.where(stage.name, "from"),
                                    remedy=_candidates(spec, port.name, roles[stage.name].ports, roles)))  # fmt: skip


def _candidates(spec: Spec, port: str, ports: Mapping[str, type], roles: Mapping[str, Role]) -> str:
    kind = ports[port]
    fitting = [name for name in spec.stages if name in roles and roles[name].kind is kind]
    if not fitting:
        return f"add a stage that gives it, and `from: {{{port}: THAT_STAGE}}`"
    return f"`from: {{{port}: STAGE}}`, where STAGE is {' or '.join(fitting)}"


def _order(spec: Spec, errors: list[AatriError]) -> list[str]:
    position = {name: k for k, name in enumerate(spec.stages)}
    sources = {
        name: [source for source in stage.inputs.values() if source in position] for name, stage in spec.stages.items()
    }
    sorter = graphlib.TopologicalSorter(sources)
    try:
        sorter.prepare()
    except graphlib.CycleError as failure:
        errors.append(_cycle(spec, list(failure.args[1]), position))
        return []
    order: list[str] = []
    ready = list(sorter.get_ready())
    while ready:
        first = min(ready, key=position.__getitem__)
        ready.remove(first)
        order.append(first)
        sorter.done(first)
        ready.extend(sorter.get_ready())
    return order


def _cycle(spec: Spec, cycle: list[str], position: Mapping[str, int]) -> SpecError:
    """The cycle as data flow, told from its stage that comes first in the file."""
    ring = cycle[:-1]
    start = min(range(len(ring)), key=lambda k: position[ring[k]])
    ring = ring[start:] + ring[:start]
    first, source = ring[0], ring[-1]
    port = next(port for port, given in spec.stages[first].inputs.items() if given == source)
    return SpecError(f"stages wait for each other: {' -> '.join([*ring, first])}",
                     where=spec.where(first, "from", port), remedy="remove one of these links")  # fmt: skip
