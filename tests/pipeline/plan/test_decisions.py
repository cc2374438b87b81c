from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aatri.errors import SpecError
from aatri.pipeline.methods.catalogue import Method, MethodPort
from aatri.pipeline.methods.code_digest import Code
from aatri.pipeline.plan.decisions import Decision, Integrity, Selection, State, decide, plan, select
from aatri.pipeline.plan.graph import StageNode, downstream, upstream
from aatri.pipeline.plan.keys import key_of, key_parts
from aatri.pipeline.plan.reasons import Reason, Why


@dataclass
class Shelf:
    """A store in memory: what the planner sees, and what stages would have made."""

    made: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    latest: dict[str, dict[str, Any]] = field(default_factory=dict)
    broken: dict[tuple[str, str], Integrity] = field(default_factory=dict)
    contents: dict[str, str] = field(default_factory=dict)

    def record(self, stage: str, key: str) -> Mapping[str, Any] | None:
        return self.made.get((stage, key))

    def records(self, stage: str) -> Iterable[Mapping[str, Any]]:
        return [record for (name, _), record in self.made.items() if name == stage]

    def last(self, stage: str) -> Mapping[str, Any] | None:
        return self.latest.get(stage)

    def accepted(self, stage: str, key: str) -> str | None:
        return None

    def integrity(self, record: Mapping[str, Any]) -> Integrity:
        return self.broken.get((record["stage"], record["key"]), Integrity.intact)

    def failed_key(self, stage: str) -> str | None:
        return None

    def interrupted_key(self, stage: str) -> str | None:
        return None

    def files(self, node: StageNode) -> Mapping[str, str]:
        return {name: self.contents.get(path, "absent") for name, path in node.files.items()}


def content(parts: Mapping[str, Any]) -> str:
    """What a stage makes: a function of its parts that forgets the option `idle`, which changes nothing."""
    options = {name: value for name, value in parts["options"].items() if name != "idle"}
    return key_of({**parts, "options": options, "key_schema": 0})


def run(nodes: tuple[StageNode, ...], shelf: Shelf, selection: Selection = Selection()) -> list[str]:  # noqa: B008
    """Carry out the plan as the runner does; the stages that were made."""
    digests: dict[str, str | None] = {}
    made = []
    for node in nodes:
        decision = decide(node, digests, shelf, 1, selection)
        record = decision.record
        if decision.state is not State.fresh:
            assert decision.key is not None
            made.append(node.name)
            record = {
                "stage": node.name,
                "key": decision.key,
                "parts": decision.parts,
                "output": {"content_digest": content(decision.parts)},
            }
            shelf.made[node.name, decision.key] = dict(record)
            shelf.broken.pop((node.name, decision.key), None)
        assert record is not None
        shelf.latest[node.name] = dict(record)
        digests[node.name] = str(record["output"]["content_digest"])
    return made


def chain(links: Mapping[str, tuple[str, ...]]) -> tuple[StageNode, ...]:
    """Nodes that use others, as in `{"a": (), "b": ("a",)}`; every one reads a file named like it."""
    nodes = []
    for name, sources in links.items():
        needs = tuple(MethodPort(f"from_{source}", "Numbers", 1, False) for source in sources)
        method = Method("made/up", 1, needs, "Numbers", 1, False, {})
        inputs = {f"from_{source}": source for source in sources}
        options = {"level": 0, "idle": 0, "file": name}
        made = {"method": method, "options": options, "files": {"file": name}, "uses": None, "written": options}
        nodes.append(StageNode(**made, code=Code("code", {}, {}), name=name, inputs=inputs, unused={}))
    return tuple(nodes)


DIAMOND = chain({"a": (), "b": ("a",), "c": ("a",), "d": ("b", "c"), "e": ()})


def changed(nodes: tuple[StageNode, ...], name: str, **changes: Any) -> tuple[StageNode, ...]:
    return tuple(replace(node, **changes) if node.name == name else node for node in nodes)


def with_option(nodes: tuple[StageNode, ...], name: str, option: str, value: int) -> tuple[StageNode, ...]:
    node = next(node for node in nodes if node.name == name)
    return changed(nodes, name, options={**node.options, option: value})


def states(nodes: tuple[StageNode, ...], shelf: Shelf) -> dict[str, str]:
    return {d.stage: d.state.value for d in plan(nodes, shelf, 1).decisions}


def reasons(nodes: tuple[StageNode, ...], shelf: Shelf, stage: str) -> list[Why]:
    return [reason.why for reason in plan(nodes, shelf, 1).of(stage).reasons]


def test_the_first_plan_runs_everything_and_the_second_nothing() -> None:
    shelf = Shelf()
    first = plan(DIAMOND, shelf, 1)
    assert {d.state for d in first.decisions} == {State.run}
    assert [r.why for r in first.of("d").reasons] == [Why.never_run, Why.upstream_maybe, Why.upstream_maybe]
    assert run(DIAMOND, shelf) == ["a", "b", "c", "d", "e"]
    assert plan(DIAMOND, shelf, 1).stale == ()


@pytest.mark.parametrize(
    ("change", "why", "text"),
    [
        ({"options": {"level": 2, "idle": 0, "file": "b"}}, Why.options, "options level: 0 -> 2"),
        ({"code": Code("other", {}, {})}, Why.code, "code: code -> other"),
        ({"method": replace(DIAMOND[1].method, version=2)}, Why.plugin_version, "version of the method: 1 -> 2"),
        ({"method": replace(DIAMOND[1].method, name="made/down")}, Why.plugin, "method: made/up -> made/down"),
        ({"method": replace(DIAMOND[1].method, schema=3)}, Why.schema, "schema Numbers: 1 -> 3"),
        ({"method": replace(DIAMOND[1].method, wants_rng=True)}, Why.seed, "seed: null -> 1"),
    ],
)
def test_every_change_has_its_reason_with_old_and_new(change: dict[str, Any], why: Why, text: str) -> None:
    shelf = Shelf()
    run(DIAMOND, shelf)
    nodes = changed(DIAMOND, "b", **change)
    decision = plan(nodes, shelf, 1).of("b")
    assert decision.state is State.run
    assert [(r.why, str(r)) for r in decision.reasons] == [(why, text)]
    assert states(nodes, shelf) == {"a": "fresh", "b": "run", "c": "fresh", "d": "maybe", "e": "fresh"}


def test_a_change_of_a_file_and_of_an_input_are_told_apart() -> None:
    shelf = Shelf()
    run(DIAMOND, shelf)
    shelf.contents["a"] = "new"
    (reason,) = plan(DIAMOND, shelf, 1).of("a").reasons
    assert (reason.why, reason.about, reason.old, reason.new) == (Why.file, "file of file", "absent", "new")
    assert run(DIAMOND, shelf) == ["a", "b", "c", "d"]
    shelf.made = {at: record for at, record in shelf.made.items() if at[0] != "b"}
    assert reasons(DIAMOND, shelf, "b") == [Why.output_missing]


def test_where_files_lie_does_not_matter() -> None:
    shelf = Shelf(contents={"a": "x", "elsewhere": "x"})
    run(DIAMOND, shelf)
    options = {**DIAMOND[0].options, "file": "elsewhere"}
    moved = changed(DIAMOND, "a", options=options, files={"file": "elsewhere"})
    assert plan(moved, shelf, 1).stale == ()


def test_an_equal_result_ends_the_work_below_it() -> None:
    shelf = Shelf()
    run(DIAMOND, shelf)
    nodes = with_option(DIAMOND, "a", "idle", 1)
    assert states(nodes, shelf) == {"a": "run", "b": "maybe", "c": "maybe", "d": "maybe", "e": "fresh"}
    assert run(nodes, shelf) == ["a"]


def test_going_back_makes_nothing() -> None:
    shelf = Shelf()
    run(DIAMOND, shelf)
    other = with_option(DIAMOND, "a", "level", 1)
    assert run(other, shelf) == ["a", "b", "c", "d"]
    assert run(DIAMOND, shelf) == []
    assert run(other, shelf) == []


@pytest.mark.parametrize("damage", [Integrity.missing, Integrity.altered])
def test_a_damaged_result_is_made_again_and_what_is_below_stays(damage: Integrity) -> None:
    shelf = Shelf()
    run(DIAMOND, shelf)
    shelf.broken["b", shelf.latest["b"]["key"]] = damage
    assert reasons(DIAMOND, shelf, "b") == [Why(damage.value)]
    assert run(DIAMOND, shelf) == ["b"]


def test_forced_stages_are_made_again_and_only_those() -> None:
    shelf = Shelf()
    run(DIAMOND, shelf)
    forced = select(DIAMOND, force=["b"])
    assert plan(DIAMOND, shelf, 1, forced).of("b").reasons == (Reason(Why.forced),)
    assert run(DIAMOND, shelf, forced) == ["b"]
    assert run(DIAMOND, shelf, select(DIAMOND, force=["all"])) == ["a", "b", "c", "d", "e"]


def test_selections_follow_the_data() -> None:
    def chosen(**how: Any) -> set[str]:
        return set(select(DIAMOND, **how).stages or ())

    assert chosen(start="b") == {"b", "d"}
    assert chosen(until="b") == {"a", "b"}
    assert chosen(start="a", until="c") == {"a", "c"}
    assert chosen(only=["c", "e"]) == {"c", "e"}
    with pytest.raises(SpecError, match="no stage 'f'"):
        chosen(until="f")
    assert upstream(DIAMOND, "d") == {"a", "b", "c"}


@st.composite
def graphs(draw: st.DrawFn) -> tuple[StageNode, ...]:
    names = [f"s{k}" for k in range(draw(st.integers(2, 9)))]
    picks = {n: draw(st.sets(st.sampled_from(names[:k]), max_size=3)) if k else set() for k, n in enumerate(names)}
    return chain({name: tuple(sorted(sources)) for name, sources in picks.items()})


def check_random_edits(nodes: tuple[StageNode, ...], seed: int) -> None:
    """Five edits; each reruns exactly the stages that depend on it."""
    chance, shelf = random.Random(seed), Shelf()
    run(nodes, shelf)
    for step in range(1, 6):
        name = chance.choice(nodes).name
        below = {name, *downstream(nodes, name)}
        match chance.choice(["option", "idle", "file", "code", "damage"]):
            case "option":
                nodes, expected = with_option(nodes, name, "level", step), below
            case "idle":
                nodes, expected = with_option(nodes, name, "idle", step), {name}
            case "file":
                shelf.contents[name], expected = f"content {step}", below
            case "code":
                nodes, expected = changed(nodes, name, code=Code(f"code {step}", {}, {})), below
            case _:
                shelf.broken[name, shelf.latest[name]["key"]] = Integrity.altered
                expected = {name}
        planned = plan(nodes, shelf, 1)
        assert {d.stage for d in planned.stale} == below
        assert [d.stage for d in planned.decisions if d.state is State.run] == [name]
        assert set(run(nodes, shelf)) == expected
        assert plan(nodes, shelf, 1).stale == ()


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(graphs(), st.integers(0, 10**9))
def test_random_edits_rerun_exactly_the_stages_that_depend_on_them(nodes: tuple[StageNode, ...], seed: int) -> None:
    check_random_edits(nodes, seed)


def test_keys_do_not_depend_on_the_order_of_options() -> None:
    node = DIAMOND[1]
    turned = replace(node, options=dict(reversed(node.options.items())))
    parts = [key_parts(n, {"from_a": "x"}, {"file": "y"}, 1) for n in (node, turned)]
    assert key_of(parts[0]) == key_of(parts[1])
    assert isinstance(plan((DIAMOND[0],), Shelf(), 1).decisions[0], Decision)


def test_a_change_of_code_names_the_modules() -> None:
    shelf = Shelf()
    nodes = changed(DIAMOND, "b", code=Code("code", {}, {"aatri.ids": "1", "aatri.units": "2"}))
    run(nodes, shelf)
    edited = changed(nodes, "b", code=Code("other", {}, {"aatri.ids": "1", "aatri.units": "3"}))
    assert [str(r) for r in plan(edited, shelf, 1).of("b").reasons] == ["code of aatri.units changed"]
    many = changed(nodes, "b", code=Code("other", {}, {f"aatri.m{k}": "1" for k in range(5)}))
    (reason,) = plan(many, shelf, 1).of("b").reasons
    assert str(reason) == "code of aatri.ids, aatri.m0, aatri.m1 and 4 more modules changed"
