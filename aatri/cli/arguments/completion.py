"""What the shell completes: stages, options, variants of the pipeline, runs and their stages, tables, formats, paths.

Nothing here may fail or be slow: what cannot be read completes nothing.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from aatri.pipeline.spec.pipeline_file import Spec

MOST = 200
"""More entries of a folder are not looked at."""
BREAKS = (":", "=")
"""Where bash parts words (COMP_WORDBREAKS): it replaces what stands after the last of them."""


def complete_in_bash(command: Callable[[], object]) -> None:
    """Answer bash, which asks by COMP_WORDS and COMP_CWORD, with what it may put in: after `run:`, `bundle`."""
    listed, at = os.environ["COMP_WORDS"], int(os.environ["COMP_CWORD"])
    typed = words_as_typed(listed.split("\n" if "\n" in listed else " "), at)
    os.environ |= {"COMP_WORDS": "\n".join(typed), "COMP_CWORD": str(len(typed) - 1)}
    value = typed[-1].partition("=")[2] if typed[-1].startswith("-") else typed[-1]
    kept = value[: max(map(value.rfind, BREAKS)) + 1]
    offered = io.StringIO()
    with contextlib.redirect_stdout(offered), contextlib.suppress(SystemExit):
        command()
    sys.stdout.write("".join(f"{line.removeprefix(kept)}\n" for line in offered.getvalue().splitlines()))


def words_as_typed(words: Sequence[str], at: int) -> list[str]:
    """The words up to that at the cursor, of those that bash has parted: `show run : bu` was `show run:bu`.

    The first word after the verb may begin with a colon: `show :bundle`.
    """
    typed: list[str] = []
    for k, word in enumerate([*words, ""][: at + 1]):
        if k > 2 and (word in BREAKS or words[k - 1] in BREAKS):
            typed[-1] += word
        else:
            typed.append(word)
    return typed


def complete_stage(ctx: typer.Context, incomplete: str) -> list[str]:
    """Stages of the pipeline the command names, or of ./pipeline.yaml."""
    spec = _spec(ctx)
    return _starting(incomplete, spec.stages if spec else ())


def complete_stage_or_all(ctx: typer.Context, incomplete: str) -> list[str]:
    """The same, and `all`."""
    return [*complete_stage(ctx, incomplete), *_starting(incomplete, ("all",))]


def complete_setting(ctx: typer.Context, incomplete: str) -> list[str]:
    """`STAGE.`, and after it the options of its method."""
    spec, (stage, dot, _) = _spec(ctx), incomplete.partition(".")
    if not spec or not dot:
        return _starting(incomplete, [f"{name}." for name in spec.stages] if spec else ())
    from aatri.pipeline.methods.catalogue import Catalogue

    with contextlib.suppress(Exception):
        catalogue = Catalogue()
        names = catalogue.option_names(spec.stages[stage].use)
        catalogue.save()
        return _starting(incomplete, [f"{stage}.{name}=" for name in sorted(names)])
    return []


def complete_method(ctx: typer.Context, incomplete: str) -> list[str]:
    """`STAGE=`, and after it the variants of its role."""
    spec, (stage, sign, _) = _spec(ctx), incomplete.partition("=")
    if not spec or not sign:
        return _starting(incomplete, [f"{name}=" for name in spec.stages] if spec else ())
    role = spec.stages[stage].use.partition("/")[0] if stage in spec.stages else ""
    return _starting(incomplete, [f"{stage}={name}" for name in _variants() if name.startswith(f"{role}/")])


def complete_role_or_variant(incomplete: str) -> list[str]:
    """Roles and their variants."""
    names = _variants()
    return _starting(incomplete, sorted({*(name.partition("/")[0] for name in names), *names}))


def complete_new_variant(incomplete: str) -> list[str]:
    """Roles, for the name of a stage to be."""
    return _starting(incomplete, sorted({f"{name.partition('/')[0]}/" for name in _variants()}))


def complete_table(ctx: typer.Context, incomplete: str) -> list[str]:
    """Tables of all kinds of artifact."""
    del ctx
    from aatri.artifacts.kinds import KINDS
    from aatri.tables.schema import tables_of

    return _starting(incomplete, sorted({name for kind in KINDS.values() for name in tables_of(kind)}))


def complete_format(incomplete: str) -> list[str]:
    """All formats."""
    from aatri.formats.registry.catalogue import FORMATS

    return _starting(incomplete, [one.name for one in FORMATS])


def complete_list_columns(incomplete: str) -> list[str]:
    """Presets of lists."""
    from aatri.formats.lists.list_columns import PRESETS

    return _starting(incomplete, PRESETS)


def complete_source_setting(incomplete: str) -> list[str]:
    """Options of a source, after its name too, and of a block of several."""
    from aatri.formats.parts.format import Reading
    from aatri.formats.parts.not_stated import NotStated

    source, colon, _ = incomplete.rpartition(":")
    names = Reading.model_fields if colon else {**Reading.model_fields, **NotStated.model_fields}
    return _starting(incomplete, [f"{source}{colon}{name}=" for name in names])


def one_of_words(*words: str) -> Callable[[str], list[str]]:
    """Some words."""
    return lambda incomplete: _starting(incomplete, words)


def complete_path(incomplete: str) -> list[str]:
    """Files and folders in the folder typed so far."""
    typed = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    with contextlib.suppress(OSError):
        entries = sorted(typed.iterdir())[:MOST]
        return _starting(incomplete, [f"{entry}/" if entry.is_dir() else str(entry) for entry in entries])
    return []


def complete_variant(ctx: typer.Context, incomplete: str) -> list[str]:
    """Variants of the pipeline."""
    spec = _spec(ctx)
    return _starting(incomplete, spec.variants if spec else ())


def complete_run(incomplete: str) -> list[str]:
    """Run folders and pipeline files below the folder typed so far."""
    return _starting(incomplete, _runs(incomplete))


def complete_run_stage(incomplete: str) -> list[str]:
    """Runs, and after `RUN:` the stages of that run."""
    run, colon, _ = incomplete.rpartition(":")
    if not colon:
        return _starting(incomplete, _runs(incomplete))
    from aatri.cli.arguments.locate import find_run

    with contextlib.suppress(Exception):
        located = find_run(Path(run) if run else None)
        return _starting(incomplete, [f"{run}:{entry['stage']}" for entry in located.stages])
    return []


def _variants() -> list[str]:
    from aatri.pipeline.methods.registry import find_stages

    with contextlib.suppress(Exception):
        return sorted(find_stages().variants)
    return []


def _starting(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _spec(ctx: typer.Context) -> Spec | None:
    """The pipeline file of a command line that is not complete yet."""
    from aatri.cli.arguments.locate import DEFAULT, in_folder
    from aatri.pipeline.spec.pipeline_file import load_spec

    named = ctx.params.get("pipeline") or ctx.params.get("run") or DEFAULT
    with contextlib.suppress(Exception):
        path = in_folder(Path(named))
        return load_spec(path if path.is_file() else DEFAULT)
    return None


def _runs(incomplete: str) -> list[str]:
    """Folders with a run.json, and pipeline files, in the folder typed so far and one below it."""
    typed = incomplete.rpartition("/")[0]
    runs = []
    with contextlib.suppress(OSError):
        entries = sorted(Path(typed or ".").iterdir())[:MOST]
        for entry in entries:
            if entry.is_dir():
                below = sorted(entry.iterdir())[:MOST] if not (entry / "run.json").is_file() else [entry]
                runs += [str(folder) for folder in below if (folder / "run.json").is_file()]
            elif entry.suffix in (".yaml", ".yml") and entry.name.startswith("pipeline"):
                runs.append(str(entry))
    return runs
