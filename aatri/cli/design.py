"""`aatri design`: the layouts of a pipeline file, its variants, side by side by what their points will be worth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_run
from aatri.cli.arguments.options import Into
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table

if TYPE_CHECKING:
    from aatri.cli.arguments.planning import Opened
    from aatri.errors import GateError

_COLUMNS = {
    "images": ("images", 1.0),
    "control": ("control_points", 1.0),
    "sigma X": ("median_sigma_x_m", 1e3),
    "Y": ("median_sigma_y_m", 1e3),
    "Z mm": ("median_sigma_z_m", 1e3),
    "weakest mm": ("weakest_point_sigma_m", 1e3),
    "criterion": ("criterion_eigenvalue", 1.0),
    "MDB image um": ("detectable_image_point_median_um", 1.0),
    "MDB control mm": ("detectable_control_median_m", 1e3),
    "uncontrolled": ("uncontrolled_observations", 1.0),
    "control gains %": ("gain_of_control_1", 1e2),
}
"""Column of the table, figure of design/criteria, and what it is multiplied by."""


@reports_errors
def design(
    pipeline: Annotated[
        Path,
        typer.Argument(
            autocompletion=complete_run,
            help="A pipeline file with a stage of role design; its variants are the layouts.",
        ),
    ] = Path("pipeline.yaml"),
    into: Into = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No narration, only the table.")] = False,
    json: Annotated[bool, typer.Option("--json", help="The figures as JSON.")] = False,
) -> None:
    """Bring the pipeline and all its variants up to date, and compare the layouts.

    Example: aatri design docs/recipes/design.yaml
    """
    from aatri.cli.arguments.locate import in_folder
    from aatri.cli.arguments.planning import Request, open_request
    from aatri.cli.run import carry_out
    from aatri.cli.run_variants import made_variants, say_failures
    from aatri.errors import SpecError
    from aatri.pipeline.plan.decisions import select
    from aatri.pipeline.spec.gates import failure_of, judge

    silent = quiet or json
    opened = open_request(Request(str(in_folder(pipeline)), str(into or "")), quiet=silent, background=True)
    stages = [node.name for node in opened.nodes if node.method.name.startswith("design/")]
    if not stages:
        raise SpecError(
            "no stage of role design",
            where=str(opened.request.pipeline),
            remedy="add `design: {use: design/criteria, from: {block, solution: bundle}}` (see aatri stages)",
        )

    running: dict[str, Any] = {"in_memory": {}}

    def made(one: Opened) -> GateError | None:
        chosen = select(one.nodes, start=None, until=None, only=(), force=())
        records, _ = carry_out(one, chosen, running, quiet=silent, debug=False)
        return failure_of(judge(one.spec, records, chosen.stages))

    compared, failed = made_variants(opened, made(opened), made)
    layouts = {s: {run.name: run.records[s]["metrics"] for run in compared if s in run.records} for s in stages}
    options = {stage: compared[0].records[stage]["options"] for stage in stages if stage in compared[0].records}
    stated = {s for s, o in options.items() if None not in (o.get("sigma_m"), o.get("distance_m"))}
    if json:
        say_json(layouts)
    else:
        for stage in stages:
            _say_layouts(stage, layouts[stage], one_criterion=stage in stated)
    say_failures(failed)


def _say_layouts(stage: str, layouts: Mapping[str, Mapping[str, Any]], *, one_criterion: bool) -> None:
    """The table of the layouts, and which of them reaches the criterion with the fewest images.

    Without a criterion that is stated each layout is held against its own medians, and they cannot be compared by it.
    """
    columns = [name for name, (figure, _) in _COLUMNS.items() if any(figure in m for m in layouts.values())]
    rows = [[name, *(_cell(m.get(_COLUMNS[c][0]), _COLUMNS[c][1]) for c in columns)] for name, m in layouts.items()]
    say()
    say_table((stage, *columns), rows, columns)
    if not one_criterion:
        say(f"each criterion is that of its own block; with sigma_m and distance_m of {stage} all meet the same")
        return
    reached = [name for name, m in layouts.items() if m["criterion_eigenvalue"] <= 1]
    if reached:
        cheapest = min(reached, key=lambda name: (layouts[name]["images"], layouts[name]["control_points"]))
        say(f"the criterion is reached by {', '.join(reached)}; with the fewest images by {cheapest}")
    elif layouts:
        nearest = min(layouts, key=lambda name: float(layouts[name]["criterion_eigenvalue"]))
        times = float(layouts[nearest]["criterion_eigenvalue"]) ** 0.5
        say(f"no layout reaches the criterion; {nearest} is nearest, {times:.3g} times too large")


def _cell(value: Any, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.4g}"
