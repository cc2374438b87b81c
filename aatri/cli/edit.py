"""`aatri edit`: what an adjustment proposes, chosen one by one, as a file of edits that the block is read with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_path, complete_run, complete_stage, one_of_words
from aatri.cli.terminal.console import reports_errors, say, say_table

if TYPE_CHECKING:
    from aatri.cli.arguments.locate import LocatedRun
    from aatri.formats.edits.edit import Edit


@reports_errors
def edit(
    run: Annotated[
        Path | None,
        typer.Argument(autocompletion=complete_run, help="Run folder or pipeline file; default ./pipeline.yaml."),
    ] = None,
    apply: Annotated[
        str,
        typer.Option(
            metavar="WHICH",
            autocompletion=one_of_words("all"),
            help="Proposals to write: `all`, or numbers: 1,3-5. Without: show them.",
        ),
    ] = "",
    stage: Annotated[
        str,
        typer.Option(
            metavar="STAGE", autocompletion=complete_stage, help="Whose proposals; default the last adjustment."
        ),
    ] = "",
    into: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            autocompletion=complete_path,
            help="The file of edits; default that which the block is read with.",
        ),
    ] = None,
) -> None:
    """Show what an adjustment proposes: switch off, renumber, exchange, reweight; with --apply, write it down.

    The measured files stay as they are: the block is read with the file of edits, and `aatri run` makes what depends on
    it. Remove a line, or the file, to undo it.
    """
    from aatri.artifacts.block import Block
    from aatri.artifacts.solution import Solution
    from aatri.cli.arguments.locate import find_run
    from aatri.formats.edits.edit import read_edits, write_edits
    from aatri.formats.edits.proposals import proposals
    from aatri.pipeline.store import run_folder as store

    located = find_run(run)
    solution = _last_solution(located, stage)
    block = _block_of(located, solution)
    adjusted = store.load(located.folder, solution.name, Solution)
    made, others = proposals(store.load(located.folder, block.name, Block), adjusted, solution.name)
    if not apply:
        _show(made, others, solution.name)
        return
    chosen = [made[k] for k in _chosen(apply, len(made))]
    target = into or block.edits
    old = read_edits(target) if target.exists() else ()
    new = [edit for edit in chosen if not any(one.same_as(edit) for one in old)]
    write_edits(target, [*old, *new])
    after = f", after {len(old)} that it had" if old else ""
    say(f"{len(new)} edit{'s' * (len(new) != 1)} written to {target}{after}")
    if len(new) < len(chosen):
        say(f"{len(chosen) - len(new)} of the chosen stood in it already")
    if target.resolve() != block.edits.resolve() or not block.reads_edits:
        say(f"the block reads it with `edits: {target}` among the options of stage {block.name}")
    say("next: aatri run")


def _show(made: Sequence[Edit], others: Sequence[str], stage: str) -> None:
    if made:
        rows = [[str(k), str(one), one.reason] for k, one in enumerate(made, start=1)]
        say_table(("", "proposal", "reason"), rows, ("",))
    else:
        say(f"{stage} proposes nothing")
    if others:
        say(
            f"no edit for: {', '.join(others)}; ties are made of image points, the rest stands in the block's own files"
        )
    if made:
        say("nothing is written; choose with --apply all, or --apply 1,3-5")


@dataclass(frozen=True)
class _StageResult:
    """A stage with its result: its name, method, and the record of how it was made."""

    name: str
    use: str
    record: Mapping[str, Any]

    @property
    def edits(self) -> Path:
        """The file of edits that a block was read with, or would be."""
        from aatri.formats.tables.source import EDITS

        options = self.record["options"]
        if options.get("edits"):
            return Path(options["edits"])
        return Path(options["path"]) / EDITS if self.use == "block/tables" else Path(EDITS)

    @property
    def reads_edits(self) -> bool:
        """Whether that file needs no option: the block has been read with it, or has it in its folder."""
        return self.use == "block/tables" or bool(self.record["options"].get("edits"))


def _last_solution(run: LocatedRun, name: str) -> _StageResult:
    """The last adjustment with a result, or that of a stage."""
    from aatri.errors import SpecError

    results = [_result_of(run, str(entry["stage"])) for entry in run.stages]
    solutions = [r for r in results if r and r.record["output"]["kind"] == "Solution" and name in ("", r.name)]
    if not solutions:
        what = f"no adjustment {name} with a result" if name else "no adjustment with a result"
        raise SpecError(what, where=str(run.folder), remedy="aatri run")
    return solutions[-1]


def _block_of(run: LocatedRun, solution: _StageResult) -> _StageResult:
    """The block that a solution was made of; refused if it is another by now, or none that edits can be read with."""
    from aatri.errors import SpecError

    adjusted = solution.record["inputs"]["block"]
    block = _result_of(run, str(adjusted["stage"]))
    if block is None or block.record["output"]["content_digest"] != adjusted["content_digest"]:
        what = f"{solution.name} was made of another block than {adjusted['stage']} has now"
        raise SpecError(what, where=str(run.folder), remedy="aatri run")
    if "edits" not in block.record["options"]:
        raise SpecError(
            f"{block.use} reads no measurements that edits could change",
            where=str(run.folder),
            remedy=f"`aatri export {block.name} tables` writes it as a block folder, which takes edits",
        )
    return block


def _result_of(run: LocatedRun, name: str) -> _StageResult | None:
    """A stage, if it has a result."""
    from aatri.pipeline.store import run_folder as store

    record = store.current_record(run.folder, name) if run.folder.is_dir() else None
    return None if record is None else _StageResult(name, str(run.stage(name)["use"]), record)


def _chosen(text: str, count: int) -> list[int]:
    """Places, from 0, of `all` or `1,3-5`."""
    from aatri.errors import SpecError

    if text == "all":
        return list(range(count))
    places = list[int]()
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        ends = (first, last if dash else first)
        if not all(end.isdecimal() and 1 <= int(end) <= count for end in ends) or int(ends[0]) > int(ends[1]):
            raise SpecError(
                f"--apply {text}: {part.strip() or 'an empty part'} is no proposal",
                remedy=f"all, or numbers from 1 to {count}: 1,3-5" if count else "there are no proposals",
            )
        places += range(int(ends[0]) - 1, int(ends[1]))
    return sorted(set(places))
