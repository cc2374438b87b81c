"""Quality gates on made-up stages: the sum of 1, 2, 3 is 6, its sigma0 1.5, and numbers have no sigma0."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from aatri.errors import AatriError, ArtifactError, Errors, GateError, SpecError
from aatri.pipeline.spec.gates import Verdict, failure_of, judge, verdicts_in
from aatri.pipeline.store.records import read_overview
from tests.made_up_stages import write_pipeline
from tests.pipeline.made_runs import opened, read_events, run

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


def project(folder: Path, gates: str, more: str = "") -> Path:
    """A pipeline with gates in line 3."""
    return write_pipeline(folder, LINES, f"run: out\nseed: 1\n{gates}\n{more}")


def wrong(path: Path, **changes: Any) -> list[str]:
    with pytest.raises(AatriError) as caught:
        opened(path, **changes)
    errors = caught.value.errors if isinstance(caught.value, Errors) else (caught.value,)
    assert all(isinstance(error, SpecError) for error in errors)
    return [f"{error.where.removeprefix(str(path) + ':')} {error.what}" for error in errors]


def verdicts(path: Path, **changes: Any) -> tuple[Verdict, ...]:
    """Run, and judge as the run did."""
    chosen = changes.get("how", {}).get("select", {}).get("until")
    _, records = run(path, **changes)
    changes.pop("how", None)
    spec, _ = opened(path, **changes)
    found = judge(spec, records.values(), None if chosen is None else {chosen})
    assert [v.plain() for v in found] == [v.plain() for v in verdicts_in(overview(path))]
    return found


def overview(path: Path) -> dict[str, Any]:
    told = read_overview(path.parent / "out")
    assert told is not None
    return told


@pytest.mark.parametrize(
    ("gates", "place", "what"),
    [
        ("gates: {ss: {total: {max: 1}}}", "3:9", "no stage 'ss'"),
        ("gates: {s: {total: {max: 1}}, b: {}}", "3:31", "no stage 'b'"),
        ("gates: [s]", "3:8", "not keys with values"),
        ("gates: {s}", "3:10", "gates of s: None, not metrics with bounds"),
        ("gates: {s: 3}", "3:12", "gates of s: 3, not metrics with bounds"),
        ("gates: {s: {total}}", "3:18", "gate of s.total: None, no bound"),
        ("gates: {s: {total: {}}}", "3:20", "gate of s.total: {}, no bound"),
        ("gates: {s: {total: 3}}", "3:20", "gate of s.total: 3, no bound"),
        ("gates: {s: {total: {maxi: 3}}}", "3:21", "unknown key 'maxi' - did you mean 'max'?"),
        ("gates: {s: {total: {max: '3'}}}", "3:26", "max is '3', not a finite number"),
        ("gates: {s: {total: {max: true}}}", "3:26", "max is True, not a finite number"),
        ("gates: {s: {total: {max}}}", "3:24", "max is None, not a finite number"),
        ("gates: {s: {total: {min: 3, max: .inf}}}", "3:34", "max is inf, not a finite number"),
        ("gates: {s: {total: {max: .nan}}}", "3:26", "max is nan, not a finite number"),
        ("gates: {s: {total: {min: 3, max: 2}}}", "3:20", "min 3 is larger than max 2"),
        ("gate: {s: {total: {max: 2}}}", "3:1", "unknown key 'gate' - did you mean 'gates'?"),
    ],
)
def test_a_gate_is_read_strictly(tmp_path: Path, gates: str, place: str, what: str) -> None:
    (told,) = wrong(project(tmp_path, gates))
    assert told.startswith(f"{place} ")
    assert what in told


def test_no_stage_is_named_like_the_gates(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, "  gates: {use: source/fixed}\n")
    assert "a stage cannot be named 'gates'" in wrong(path)[0]


@pytest.mark.slow
def test_a_gate_is_passed_on_its_bounds_and_fails_beyond(tmp_path: Path) -> None:
    path = project(tmp_path, "gates: {s: {total: {min: 6, max: 6}, sigma0: {max: 1.5}, seconds: {min: 0}}}")
    assert [v.passed for v in verdicts(path)] == [True, True, True]
    assert overview(path)["status"] == "done"
    path = project(tmp_path, "gates: {s: {total: {max: 5.9}, sigma0: {min: 1.6, max: 2}}, a: {points: {max: 3}}}")
    found = verdicts(path)
    assert [v.passed for v in found] == [False, False, True]
    assert overview(path)["status"] == "gate_failed"
    error = failure_of(found)
    assert isinstance(error, GateError)
    assert error.exit_code == 6
    assert str(error).splitlines() == [
        "2 quality gates failed; the results are written",
        f"    {path}:3:20: s.total: 6, wanted at most 5.9",
        f"    {path}:3:40: s.sigma0: 1.5, wanted from 1.6 to 2",
    ]


def test_a_figure_without_a_value_fails_its_gate(tmp_path: Path) -> None:
    found = verdicts(project(tmp_path, "gates: {a: {sigma0: {max: 99}}}"))
    assert [v.passed for v in found] == [False]
    assert "a.sigma0: no value, wanted at most 99" in str(failure_of(found))


def test_a_metric_that_the_stage_does_not_have_is_an_error_and_the_results_stay(tmp_path: Path) -> None:
    path = project(tmp_path, "gates: {s: {totl: {max: 99}}}")
    with pytest.raises(SpecError, match="s has no metric 'totl' - did you mean 'total'") as caught:
        run(path)
    assert caught.value.where == f"{path}:3:19"
    assert overview(path)["status"] == "failed"
    assert (tmp_path / "out" / "current" / "s.h5").exists()
    begun, _ = run(project(tmp_path, "gates: {s: {total: {max: 99}}}"))
    assert begun == []
    assert overview(path)["status"] == "done"
    with pytest.raises(SpecError, match="totl"):  # also where nothing is to be done
        run(project(tmp_path, "gates: {s: {totl: {max: 99}}}"))


@pytest.mark.slow
def test_a_changed_bound_makes_nothing_again_and_is_judged(tmp_path: Path) -> None:
    verdicts(project(tmp_path, "gates: {s: {total: {max: 6}}}"))
    for bound, status in ((5, "gate_failed"), (7, "done")):
        path = project(tmp_path, f"gates: {{s: {{total: {{max: {bound}}}}}}}")
        assert run(path)[0] == []
        assert overview(path)["status"] == status
    path = project(tmp_path, "gates: {s: {total: {max: 5}}}")
    run(path)
    before = (tmp_path / "out" / "events.jsonl").stat().st_size
    assert not verdicts(path)[0].passed  # told again
    assert (tmp_path / "out" / "events.jsonl").stat().st_size == before  # and nothing is written anew


def test_a_stage_that_a_partial_run_does_not_reach_is_not_judged(tmp_path: Path) -> None:
    path = project(tmp_path, "gates: {s: {totl: {max: 5}}, a: {points: {max: 2}}}")
    found = verdicts(path, how={"select": {"until": "a"}})
    assert [(v.gate.stage, v.passed) for v in found] == [("a", False)]


def test_gates_of_a_failed_run_are_not_judged(tmp_path: Path) -> None:
    path = project(tmp_path, "gates: {a: {points: {max: 2}}}")
    with pytest.raises(AatriError, match="no convergence"):
        run(path, uses=("s=sum/stubborn",))
    assert overview(path)["status"] == "failed"
    assert overview(path)["gates"] == []


def test_events_tell_every_gate_and_how_the_run_ended(tmp_path: Path) -> None:
    verdicts(project(tmp_path, "gates: {s: {total: {max: 5}}}"))
    told = list(read_events(tmp_path / "out"))[-2:]
    expected = {"event": "gate", "stage": "s", "metric": "total", "min": None, "max": 5, "value": 6.0, "passed": False}
    assert {name: value for name, value in told[0].items() if name != "time"} == expected
    assert (told[1]["event"], told[1]["status"]) == ("ended", "gate_failed")
    json.dumps(told)


@pytest.mark.slow
def test_the_command_line_sets_bounds_and_takes_gates_away(tmp_path: Path) -> None:
    path = project(tmp_path, "gates: {s: {total: {max: 5}}}")
    assert [v.passed for v in verdicts(path, sets=("gates.s.total.max=6",))] == [True]
    assert verdicts(path, sets=("gates.s.total=off",)) == ()
    assert [v.gate.metric for v in verdicts(path, sets=("gates.a.points.min=4",))] == ["total", "points"]
    assert wrong(path, sets=("gates.s.total.min=7",)) == ["3:20 gate of s.total: min 7 is larger than max 5"]
    assert wrong(path, sets=("gates.ss.total.min=7",))[0].startswith("--set gates.ss.total.min=7 no stage 'ss'")
    assert wrong(path, sets=("gates.s.total.max=x",)) == [
        "--set gates.s.total.max=x gate of s.total: max is 'x', not a finite number"
    ]


def test_a_variant_sets_bounds_one_by_one(tmp_path: Path) -> None:
    path = project(
        tmp_path,
        "gates: {s: {total: {min: 1, max: 5}, sigma0: {max: 9}}}",
        "variants: {far: {s: {with: {offset: 9.0}}, gates: {s: {total: {max: 15}, sigma0: off}}}}\n",
    )
    spec, _ = opened(path, variant="far")
    (found,) = judge(spec, run(path, variant="far")[1].values())
    assert (found.value, found.gate.min, found.gate.max, found.passed) == (15.0, 1, 15, True)
    assert judge(opened(path)[0], run(path)[1].values())[0].passed is False
    path = project(tmp_path, "", "variants: {far: {gates: {ss: {total: {max: 15}}}}}\n")
    assert wrong(path)[0].startswith("4:26 no stage 'ss'")
    path = project(tmp_path, "", "variants: {far: {gates: {s: {total: {max: x}}}}}\n")
    assert wrong(path, variant="far")[0].startswith("4:37 gate of s.total: max is 'x'")


GATE = {"stage": "s", "metric": "total", "min": None, "max": 3, "value": 2.5, "passed": True}


@pytest.mark.parametrize(
    "gates",
    [[3], [{}], {}, [GATE | {"max": "1"}], [GATE | {"max": None}], [GATE | {"stage": "../x"}], [GATE | {"value": "1"}]],
)
def test_gates_of_another_shape_in_run_json_are_damage(tmp_path: Path, gates: object) -> None:
    path = project(tmp_path, "gates: {s: {total: {max: 6}}}")
    run(path)
    place = tmp_path / "out" / "run.json"
    whole = overview(path)
    place.write_text(json.dumps(whole | {"gates": [GATE]}))
    assert overview(path)["gates"] == [GATE]
    place.write_text(json.dumps(whole | {"gates": gates}))
    with pytest.raises(ArtifactError, match="damaged"):
        overview(path)
    run(path)
    assert overview(path)["gates"] == whole["gates"]


@pytest.mark.parametrize(
    ("gates", "passed"),
    [
        ("", False),
        ("gates: {s: {total: {max: 99}}}", False),
        ("gates: none", True),
        ("gates: {s: {contradictions: off}}", True),
        ("gates: {s: {contradictions: {max: 2}}}", True),
        ("gates: {s: {contradictions: {max: 1}}}", False),
    ],
)
def test_a_result_that_contradicts_itself_fails_without_a_gate_unless_that_is_said(
    tmp_path: Path, gates: str, passed: bool
) -> None:
    spec, _ = opened(project(tmp_path, gates))
    why = "the result contradicts its own tests: heights of two surfaces"
    record = {"stage": "s", "seconds": 1.0, "warnings": ["another", why], "metrics": {"total": 6, "contradictions": 2}}
    found = judge(spec, [record])
    error = failure_of(found)
    assert (error is None) == passed
    if error is not None and "contradictions" not in gates:
        assert str(error).startswith("the result contradicts its own tests")
        assert "s.contradictions: 2, wanted at most 0" in str(error)
        assert why in str(error)
        assert error.exit_code == 6
    clean = {**record, "metrics": {"total": 6, "contradictions": 0}, "warnings": []}
    assert failure_of(judge(spec, [clean])) is None
