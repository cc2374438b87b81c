"""From the command line to a plan: the pipeline with what the command line changes in it, wired and planned.

A run keeps what was asked for in its run.json, so that a verb that is given the run's folder plans the same pipeline.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.cli.arguments.locate import DEFAULT, overview_of, run_or_pipeline
from aatri.cli.terminal.compiling import wait_for
from aatri.cli.terminal.console import is_terminal, narrate
from aatri.errors import ArtifactError, SpecError
from aatri.ids import several

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aatri.pipeline.methods.catalogue import Catalogue
    from aatri.pipeline.methods.compile_kernels import Compilation
    from aatri.pipeline.plan.decisions import Plan, Selection
    from aatri.pipeline.plan.graph import StageNode
    from aatri.pipeline.plan.view import StoreView
    from aatri.pipeline.run.task import StageSource
    from aatri.pipeline.spec.pipeline_file import Spec


@dataclass(frozen=True)
class Request:
    """Which pipeline, and how it is changed: `--into --set --use --variant --local-plugins`."""

    pipeline: str
    into: str = ""
    set_: tuple[str, ...] = ()
    use: tuple[str, ...] = ()
    variant: str = ""
    local_plugins: bool = False

    def plain(self) -> dict[str, Any]:
        """As JSON takes it; paths hold from anywhere."""
        into = str(Path(self.into).absolute()) if self.into else ""
        return {**asdict(self), "pipeline": str(Path(self.pipeline).absolute()), "into": into}


@dataclass(frozen=True)
class Opened:
    """A pipeline ready to be planned."""

    request: Request
    spec: Spec
    nodes: tuple[StageNode, ...]
    source: StageSource
    compilation: Compilation | None = None

    def view(self, *, verify: bool = False) -> StoreView:
        """The store of its run."""
        from aatri.pipeline.plan.view import StoreView

        return StoreView(self.spec.run, verify=verify)

    def plan(self, selection: Selection | None = None, *, verify: bool = False) -> Plan:
        """What is to be done."""
        from aatri.pipeline.plan.decisions import Selection, plan

        view = self.view(verify=verify)
        planned = plan(self.nodes, view, self.spec.seed, selection or Selection())
        view.save()
        return planned


def open_request(request: Request, *, quiet: bool = False, background: bool = False, compiles: bool = True) -> Opened:
    """Read and wire the pipeline of a request; unless quiet, tell of compilation, which that may take.

    With `background` compilation may still be under way: who runs stages waits for what each of them needs. Who runs
    none needs none (`compiles`).

    Raises
    ------
    AatriError
        Whatever is wrong with the pipeline, its plugins and options.
    """
    from aatri.pipeline.methods.catalogue import Catalogue
    from aatri.pipeline.methods.compile_kernels import without_compiler
    from aatri.pipeline.run.task import StageSource

    spec, local = read_request(request)
    catalogue = Catalogue(local, runs_code=request.local_plugins)
    uses = [stage.use for stage in spec.stages.values()] + [text.partition("=")[2] for text in request.use]
    compilation = compilation_of(uses, catalogue, quiet=quiet) if compiles else None
    if compilation is None and (compiles or not lacking_kernels(uses, catalogue)):
        spec, nodes, notes = wired(spec, request, catalogue)
    else:
        spec, nodes, notes = without_compiler(wired, spec, request, catalogue)
    if compilation is not None and not background:
        if quiet:
            compilation.wait()
        else:
            wait_for(compilation, narrate, terminal=is_terminal())
    for note in notes:
        narrate(f"note: {note}")
    return Opened(request, spec, nodes, StageSource(local=local, runs_code=request.local_plugins), compilation)


def read_request(request: Request) -> tuple[Spec, Path | None]:
    """The pipeline of a request as it is written, with its variant; and the folder of stages, if it is asked for.

    Raises
    ------
    SpecError
        Whatever is wrong with the file.
    """
    from aatri.cli.arguments.options import local_stages
    from aatri.pipeline.spec.overrides import with_variant
    from aatri.pipeline.spec.pipeline_file import load_spec

    path = Path(request.pipeline)
    if path == DEFAULT and not path.exists():
        raise SpecError(
            "no pipeline.yaml in this folder", remedy="`aatri new` writes one here, or give the path of one"
        )
    local = local_stages(request.local_plugins, path)
    if local is not None and not local.is_dir():
        narrate(f"note: --local-plugins: there is no folder {local}")
        local = None
    spec = load_spec(path, Path(request.into) if request.into else None)
    return (with_variant(spec, request.variant) if request.variant else spec), local


def wired(spec: Spec, request: Request, catalogue: Catalogue) -> tuple[Spec, tuple[StageNode, ...], list[str]]:
    """The pipeline with what a request changes in it, wired; this imports the stages that the cache does not know."""
    from aatri.pipeline.plan.graph import wire
    from aatri.pipeline.spec.overrides import with_set, with_use

    spec, notes = with_use(spec, request.use, catalogue)
    spec = with_set(spec, request.set_)
    return spec, wire(spec, catalogue), notes


def compilation_of(uses: Sequence[str], catalogue: Catalogue, *, quiet: bool = False) -> Compilation | None:
    """Begin to compile what stages reach, where that has not been done on this machine and the wheel has it not."""
    from aatri.pipeline.methods.compile_kernels import Compilation

    lacking = lacking_kernels(uses, catalogue)
    if not lacking:
        return None
    if not quiet:
        modules = several(len(lacking), "module")
        narrate(f"compiling the inner loops for this processor, once: {modules}, a second or two each")
    return Compilation(lacking)


def lacking_kernels(uses: Sequence[str], catalogue: Catalogue) -> dict[str, Path]:
    """Kernel modules that stages import at once and that neither the cache of this machine has nor the wheel."""
    from aatri.pipeline.methods.compile_kernels import kernels_of, missing
    from aatri.pipeline.methods.kernel_cache import CARRIED, copy_compiled, remove_unused, use_kernel_cache

    folder = use_kernel_cache()
    if folder is None:
        return {}
    codes = catalogue.codes(uses)
    kernels = kernels_of(codes)
    remove_unused(folder, kernels)
    if not (lacking := missing(kernels)):
        return {}
    copy_compiled(lacking, CARRIED, folder)
    return missing(kernels_of(codes, at_once=True))  # others are compiled when a block needs them


def open_run(
    named: Path | None,
    *,
    local_plugins: bool = False,
    set_: tuple[str, ...] = (),
    use: tuple[str, ...] = (),
    quiet: bool = False,
    background: bool = False,
    compiles: bool = True,
) -> Opened:
    """The pipeline of a file, or of a run folder as it was run last; by default of ./pipeline.yaml.

    That a run was made with --local-plugins does not permit to execute code of the project again: a run folder may
    come from anyone. For the same reason the pipeline it names is only opened where it is that of its project. `set_`
    and `use` are added to what was asked for then.
    """
    from aatri.pipeline.store.known_runs import is_of_this_run

    path = run_or_pipeline(named)
    if not path.is_dir():
        request = Request(str(path), set_=set_, use=use, local_plugins=local_plugins)
        return open_request(request, quiet=quiet, background=background, compiles=compiles)
    kept = overview_of(path).get("request")
    if not kept:
        raise ArtifactError(
            "made by an older aatri; its pipeline is not known", where=str(path), remedy="give the pipeline file"
        )
    if kept.get("local_plugins") and not local_plugins:
        raise SpecError(
            "was run with --local-plugins: planning it executes code of the project",
            where=str(path),
            remedy="--local-plugins, if you trust the project",
        )
    if not is_of_this_run(path, Path(kept["pipeline"])):
        what = "its run.json names a pipeline outside of its project; you have not made this run here: not opened"
        raise ArtifactError(what, where=str(path), remedy="give the pipeline file, and --into for the run")
    into = "" if kept["variant"] else str(path)
    request = Request(
        kept["pipeline"],
        kept["into"] or into,
        (*kept["set_"], *set_),
        (*kept["use"], *use),
        kept["variant"],
        local_plugins,
    )
    return open_request(request, quiet=quiet, background=background, compiles=compiles)
