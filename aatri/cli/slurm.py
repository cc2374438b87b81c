"""A pipeline as a script for SLURM: one job per stage, waiting for the jobs of the stages above it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.ids import printable
from aatri.pipeline.run.overview import arguments_of

if TYPE_CHECKING:
    from aatri.cli.arguments.planning import Opened

_HEAD = """\
#!/usr/bin/env bash
# Submits the stages of {pipeline} to SLURM, each waiting for those it needs.
# Arguments go to sbatch: bash {name} --partition=long --cpus-per-task=8
set -euo pipefail
cd {folder}
submit() {{  # NAME DEPENDENCIES COMMAND
    local name=$1 after=$2; shift 2
    sbatch --parsable --job-name="aatri-$name" ${{after:+--dependency=afterok:$after}} --kill-on-invalid-dep=yes \\
        "${{options[@]}}" --wrap "$*"
}}
options=("$@")
"""


def script(opened: Opened) -> str:
    """The text of the script; its last job makes the results current and writes the report."""
    arguments = arguments_of(opened.request.plain() | {"into": opened.request.into})
    # within a comment a name must not begin a line of its own
    lines = [
        _HEAD.format(pipeline=printable(str(opened.spec.path)), name="SCRIPT", folder=shlex.quote(str(Path.cwd())))
    ]
    for node in opened.nodes:
        after = ":".join(f"$job_{source}" for source in dict.fromkeys(node.inputs.values()))
        command = shlex.join(["aatri", "exec", opened.request.pipeline, node.name, *arguments])
        lines.append(f'job_{node.name}=$(submit {node.name} "{after}" {shlex.quote(command)})\n')
    after = ":".join(f"$job_{node.name}" for node in opened.nodes)
    command = shlex.join(["aatri", "run", opened.request.pipeline, *arguments])
    lines.append(f'job_report=$(submit report "{after}" {shlex.quote(command)})\n')
    lines.append('echo "$job_report"\n')
    return "".join(lines)
