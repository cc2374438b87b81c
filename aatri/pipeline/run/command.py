"""The command that makes a run again, from what was asked for when it was made."""

import shlex
from collections.abc import Mapping
from typing import Any


def arguments_of(request: Mapping[str, Any]) -> list[str]:
    """The arguments beside the pipeline file: `--into --set --use --variant --local-plugins`."""
    given = ["--into", str(request["into"])] if request.get("into") else []
    given += [part for text in request.get("set_") or () for part in ("--set", str(text))]
    given += [part for text in request.get("use") or () for part in ("--use", str(text))]
    given += ["--variant", str(request["variant"])] if request.get("variant") else []
    return [*given, *(["--local-plugins"] if request.get("local_plugins") else [])]


def command_of(overview: Mapping[str, Any]) -> str:
    """`aatri run PIPELINE ...` of a run.json, quoted for a shell."""
    request = overview.get("request") or {}
    pipeline = str(request.get("pipeline") or overview.get("pipeline") or "pipeline.yaml")
    return shlex.join(["aatri", "run", pipeline, *arguments_of(request)])
