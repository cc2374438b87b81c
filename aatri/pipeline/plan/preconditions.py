"""What has to be there before a run begins: the results that it does not make, and the files that options name."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from aatri.errors import AatriError, ArtifactError, InputError, raise_all
from aatri.ids import did_you_mean
from aatri.pipeline.plan.decisions import Plan, State
from aatri.pipeline.plan.graph import StageNode
from aatri.pipeline.spec.pipeline_file import Spec


def check_inputs(spec: Spec, nodes: tuple[StageNode, ...], planned: Plan) -> None:
    """See that every input of a selected stage is there or will be made.

    Raises
    ------
    ArtifactError
        If a stage outside the selection is stale but needed.
    InputError
        If a file or folder does not exist that an option of a stage to be made names.
    """
    by_name = {d.stage: d for d in planned.decisions}
    errors: list[AatriError] = []
    for node in nodes:
        for source in dict.fromkeys(node.inputs.values()):
            above = by_name[source]
            if by_name[node.name].selected and not above.selected and above.state is not State.fresh:
                reasons = "; ".join(str(reason) for reason in above.reasons)
                errors.append(ArtifactError(f"{node.name} needs {source}, which is not selected and not up to date "
                                            f"({reasons})", remedy=f"aatri run --until {node.name}"))  # fmt: skip
    due = {d.stage for d in planned.stale}
    errors += [error for node in nodes if node.name in due for error in _absent(spec, node)]
    raise_all(errors)


def _absent(spec: Spec, node: StageNode) -> Iterator[InputError]:
    """The files that are not there, each at its line; what else may be wrong with one its reader says."""
    for option, text in node.files.items():
        path = Path(text)
        try:
            path.lstat()
        except FileNotFoundError:
            folder, names = path.parent, list[str]()
            with contextlib.suppress(OSError):
                names = sorted(entry.name for entry in folder.iterdir())
            near = did_you_mean(path.name, names).removeprefix(" - ") or "put it there or mend the path"
            what = f"{option} is {text!r}, which does not exist" + ("" if folder.is_dir() else ", nor does its folder")
            yield InputError(what, where=spec.where(node.name, "with", *option.split(".")), remedy=near)
        except (OSError, ValueError):
            continue
