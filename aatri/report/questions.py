"""The sections of the page: each one question, answered by pictures and tables of the last result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.errors import SpecError
from aatri.ids import did_you_mean
from aatri.report.drawing.charts import (
    correlation_pictures,
    groups_chart,
    iterations_chart,
    redundancy_chart,
    sigma0_chart,
)
from aatri.report.drawing.network import ellipses_picture, network_picture
from aatri.report.drawing.picture import Picture
from aatri.report.drawing.plan import block_plan
from aatri.report.drawing.ties import (
    angles_chart,
    common_points,
    intersection_angles,
    overlap_picture,
    rays_pictures,
    sigma_pictures,
    ties_picture,
)
from aatri.report.drawing.vectors import error_field_pictures
from aatri.report.facts import has_scale
from aatri.report.sections import calibration, evaluation, network, observations, reliability, solution
from aatri.report.sections.block import camera_tables
from aatri.report.sections.observations import proposed_numbers_table, suspects_tables
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import accuracy_table
from aatri.report.sections.tie_points import tie_point_pictures, weakest_images
from aatri.report.view.run_view import RunView


def questions(run: RunView, around: Surroundings) -> list[PageSection]:
    """The sections that have something to tell, in the order in which they are asked."""
    block, last = around.block, around.solution
    made = [_where(around), _accuracy(run, around)]
    if last is None:
        network = _network(block, None)
        made = [*made, _ties(block, None), network] if block is None or len(block.images) else [network, *made[1:]]
    else:
        observed = _network(block, last)
        made += [_certainty(block, last), _ties(block, last)]
        if last.images.oriented.any():
            made.append(observed)
        elif not observed.empty:  # a network alone: its picture is the plan
            made[0] = observed
        made += [_residuals(last, around), _tests(last), _parameters(last), _convergence(run, last)]
    metric = has_scale(block)
    return [section.in_metres(metric) for section in made if not section.empty]


class NoPicture(SpecError, KeyError):
    """A run has no picture of this name."""


@dataclass(frozen=True)
class Gallery:
    """The pictures of a run by name, and the names of those that answer a question."""

    pictures: Mapping[str, Picture]
    questions: Mapping[str, Sequence[str]]

    def chosen(self, names: Sequence[str], where: str) -> dict[str, Picture]:
        """Pictures by their names, the names of their questions, or `all`.

        Raises
        ------
        NoPicture
            If there is none of a name; `where` is the run.
        """
        groups = {**self.questions, "all": list(self.pictures)}
        for name in names:
            if name not in groups and name not in self.pictures:
                remedy = f"one of {', '.join(self.pictures)}" if self.pictures else "the run has none"
                hint = did_you_mean(name, [*self.pictures, *self.questions])
                raise NoPicture(f"no picture {name!r}{hint}", where=where, remedy=remedy)
        return {
            one: self.pictures[one] for name in names for one in ([name] if name in self.pictures else groups[name])
        }


def gallery(run: RunView, around: Surroundings) -> Gallery:
    """All pictures of the page."""
    sections = [section for section in questions(run, around) if section.pictures]
    return Gallery(
        {picture.name: picture for section in sections for picture in section.pictures},
        {section.name: [picture.name for picture in section.pictures] for section in sections},
    )


def _where(around: Surroundings) -> PageSection:
    made = PageSection("plan", "Where are the images and the points?")
    if around.block is not None:
        made.pictures.extend(present(block_plan(around.block, around.solution)))
        made.tables.extend(camera_tables(around.block))
    return made


def _accuracy(run: RunView, around: Surroundings) -> PageSection:
    """Differences of the last evaluation of a result; without one, what all evaluations say."""
    made = PageSection("accuracy", "How accurate is the result?")
    made.tables.extend(present(accuracy_table({s.name: s.metrics for s in run.of_kind(Evaluation)})))
    evaluations = run.readable(Evaluation)
    for stage, one in reversed(evaluations.items()):
        section = PageSection(stage, stage)
        evaluation.show(section, one, around)
        made.add(section.of_stage() if len(evaluations) > 1 else section)
    return made


def _certainty(block: Block | None, last: Solution) -> PageSection:
    made = PageSection("certainty", "How certain are points and orientations, and where is control missing?")
    made.tables.extend(present(solution.precision_table(last), solution.orientations(block, last)))
    if block is not None:
        made.pictures.extend([*sigma_pictures(block, last), *present(ellipses_picture(block, last))])
    return made


def _ties(block: Block | None, last: Solution | None) -> PageSection:
    """Of a block that is not adjusted: what its image points alone say."""
    made = PageSection("ties", "How well are the images tied to each other?")
    if block is None or (last is not None and not last.images.oriented.any()):
        return made
    pairs = common_points(block, last)
    if last is not None:
        made.pictures.extend(
            [
                *present(overlap_picture(block, last)),
                *rays_pictures(block, last),
                *present(angles_chart(intersection_angles(block, last))),
            ]
        )
    made.pictures.extend([*present(ties_picture(block, last, pairs)), *tie_point_pictures(block, last, pairs)])
    made.tables.extend(present(weakest_images(block, pairs)))
    return made


def _network(block: Block | None, last: Solution | None) -> PageSection:
    made = PageSection("network", "What holds the network together?")
    if block is not None and (len(block.geodetic) or len(block.relative_control)):
        made.pictures.extend(present(network_picture(block, last)))
        made.tables.extend(network.tables(block, last) if last is not None else [])
    return made


def _residuals(last: Solution, around: Surroundings) -> PageSection:
    made = PageSection("residuals", "Do the residuals follow the standard deviations given?")
    made.tables.extend(present(reliability.variance_table(last), observations.of_images(last)))
    made.pictures.extend(
        [*present(groups_chart(reliability.groups(last))), *solution.image_residual_pictures(last, around)]
    )
    made.pictures.extend([*solution.position_pictures(last), *solution.tie_residuals(last)])
    return made


def _tests(last: Solution) -> PageSection:
    made = PageSection("tests", "What was left out, and which errors could hide?")
    if last.redundancy and not last.suspects.staying_out.any():
        made.notes.append("Nothing was left out: every observation passed its test.")
    made.tables.extend([*suspects_tables(last.suspects), *present(proposed_numbers_table(last.proposed_numbers))])
    made.tables.extend(reliability.reliability_tables(last))
    made.pictures.extend(present(redundancy_chart(last)))
    return made


def _parameters(last: Solution) -> PageSection:
    made = PageSection("parameters", "What was estimated beside points and orientations?")
    made.tables.extend(calibration.parameter_tables(last))
    fields = last.error_fields
    made.pictures.extend(correlation_pictures(last))
    made.pictures.extend(error_field_pictures(fields) if fields is not None and len(fields) else [])
    return made


def _convergence(run: RunView, last: Solution) -> PageSection:
    made = PageSection("convergence", "Did the adjustment converge?")
    made.pictures.extend(present(iterations_chart(last)))
    sigma0 = {s.name: float(s.metrics["sigma0"]) for s in run.stages if s.metrics.get("sigma0")}  # type: ignore[arg-type]
    made.pictures.extend(present(sigma0_chart(sigma0)))
    made.tables.extend(present(solution.iterations_table(last)))
    return made
