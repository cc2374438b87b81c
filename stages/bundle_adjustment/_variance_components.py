"""Options of variance components, and what a bundle adjustment does with them."""

from collections.abc import Callable
from dataclasses import replace

from pydantic import field_validator

from aatri.adapters.bundle.bundle_input import GroupLevel, variance_groups
from aatri.adapters.observation_tables import variance_table
from aatri.artifacts.block import Block
from aatri.artifacts.solution import VarianceComponents
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.orientation.bundle.variance_groups import variance_components, variance_notes
from aatri.plugin import Field, Options


class VarianceComponentOptions(Options):
    """Standard deviations of groups of observations from their own residuals."""

    groups: tuple[GroupLevel, ...] = Field(
        ("kind",), description="what has a standard deviation of its own: kind (always), camera, flight, group"
    )
    apply: bool = Field(False, description="adjust with them; else they are proposed only")

    @field_validator("groups", mode="before")
    @classmethod
    def _as_tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value


def with_variance_components(
    block: Block,
    done: AdjustedBlock,
    adjust: Callable[[BundleInput], BundleResult],
    options: VarianceComponentOptions | None,
) -> tuple[AdjustedBlock, VarianceComponents | None]:
    """The components as a table, and the block adjusted with them where they are to be applied."""
    if options is None:
        return done, None
    groups = variance_groups(block, done.inputs, options.groups)
    components, inputs, result = variance_components(done.inputs, done.result, adjust, groups)
    notes = (*done.notes, *variance_notes(groups.names, components, applied=options.apply))
    done = replace(done, inputs=inputs, result=result) if options.apply else done
    done = replace(done, notes=notes)
    return done, variance_table(groups.names, components, applied=options.apply)
