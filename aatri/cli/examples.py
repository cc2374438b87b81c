"""Examples of every verb, shown by `--help`: the arguments, and what they do."""

EXAMPLES: dict[str, tuple[tuple[str, str], ...]] = {
    "run": (
        ("run", "the pipeline.yaml of this folder"),
        ("run --set bundle.reliability=true --into tested", "with another option, into another folder"),
        ("run --use start=initial_orientation/graph --from start", "another method, and what depends on it"),
        ("run --dry-run", "what would be done, and why"),
        ("run -v --open", "with the logs of the stages; at the end the report in the browser"),
    ),
    "check": (
        ("check", "what a run of ./pipeline.yaml would refuse"),
        ("check project --set bundle.datum=free", "the same with an option changed"),
    ),
    "status": (("status", "of ./pipeline.yaml"), ("status runs/block --verify", "of a run, every file read again")),
    "dag": (("dag", "the stages and what they take"), ("dag --dot | dot -Tsvg > dag.svg", "as a picture")),
    "show": (
        ("show :bundle", "what the result of the stage `bundle` holds"),
        ("show :bundle residuals --all", "all residuals, the largest first"),
        ("show runs/block:bundle points --json", "as JSON, with units"),
    ),
    "metrics": (("metrics", "the figures of all stages"), ("metrics runs/block --json", "as JSON")),
    "compare": (
        ("compare run calibrated", "key figures, and what was changed"),
        ("compare runs/block --variants", "a run with its variants"),
        ("compare run calibrated --form markdown", "one table to paste"),
        ("compare run calibrated --page both.html", "the pictures of both side by side"),
    ),
    "edit": (("edit", "what the adjustment proposes"), ("edit --apply 1,3-5", "write some of it into edits.yaml")),
    "measure": (
        ("measure block", "the page of a block folder, in the browser"),
        ("measure block --run runs/block", "the places of points are those of this run"),
        ("measure block --no-open --port 8100", "its address alone, on a port of one's own"),
    ),
    "design": (("design", "all layouts of ./pipeline.yaml side by side"),),
    "stages": (
        ("stages", "all roles and methods"),
        ("stages bundle_adjustment/bundle", "one method: equations, ports, options"),
    ),
    "formats": (("formats", "all formats"), ("formats colmap", "what one carries")),
    "export": (
        ("export run tables results", "the last adjustment as CSV files"),
        ("export run:bundle colmap model", "for another program"),
        ("export run slurm jobs.sh", "the pipeline as jobs of a cluster"),
    ),
    "convert": (("convert sparse --to opensfm out", "a model of COLMAP for OpenSfM"),),
    "plot": (
        ("plot run", "the pictures that there are"),
        ("plot run plan ties --format pdf --into figures", "two of them"),
    ),
    "report": (
        ("report runs/block --pdf", "as PDF too"),
        ("report", "of ./pipeline.yaml"),
        ("report runs/block --open", "of a run, shown in the browser"),
    ),
    "new": (
        ("new", "the demo"),
        ("new survey --block sample", "the block of the tutorial, in files"),
        ("new survey --block tables", "a folder for a block of digital images"),
        ("new survey --block film", "for film with fiducial marks"),
        ("new survey --block reduced", "for photo coordinates that are reduced already"),
        ("new survey --from project.psz", "a pipeline for the files of another program"),
        ("new --plugin interior_orientation/mine", "a stage of your own, with a test"),
    ),
    "schema": (("schema --out pipeline.schema.json", "for an editor that completes pipeline.yaml"),),
    "accept": (("accept all -m 'only comments changed'", "results stay in spite of other code"),),
    "exec": (("exec runs/block bundle", "one stage, as a scheduler does it"),),
    "gc": (("gc --dry-run", "what would be removed"), ("gc --keep 0 --older 30", "older than 30 days")),
}


def epilog(verb: str) -> str:
    """The examples of a verb, for its help."""
    examples = EXAMPLES.get(verb, ())
    width = max((len(command) for command, _ in examples), default=0)
    lines = [f"  aatri {command:{width}}  {what}" for command, what in examples]
    return "\b\nExamples:\n" + "\n".join(lines) if lines else ""
