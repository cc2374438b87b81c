"""aatri from Python: blocks from arrays, pipelines, runs, single stages, tables as DataFrames. See docs/python.md.

import aatri
run = aatri.run("pipeline.yaml", set=["bundle.max_iterations=9"])
run["bundle"].metrics["sigma0"]
run["bundle"].to_dataframe("residuals")
"""

from aatri.api.blocks import block_from
from aatri.api.frames import to_dataframe
from aatri.api.plots import Plots
from aatri.api.runs import Run, Stage, open_run, run_pipeline
from aatri.api.stages import StageCall, stage_call

__all__ = ["Plots", "Run", "Stage", "StageCall", "block_from", "open_run", "run_pipeline", "stage_call", "to_dataframe"]
