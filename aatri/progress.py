"""What a method may tell the outside while it works: a message, a warning, how far it is, a checkpoint.

Methods take a `Reporter` and never print; long ones take a `Checkpoint` too, so that a run that was killed goes on from
there. `SILENT` is the default everywhere: it keeps nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy.typing as npt


class Reporter(Protocol):
    """Receives messages of a running method."""

    def log(self, message: str) -> None:
        """Take a line for the log."""

    def warn(self, message: str) -> None:
        """Take a line for the log that the user must see."""

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Take how many of `total` steps are done; a total of 0: nobody knows how many there will be."""


class Checkpoint(Protocol):
    """Keeps arrays of a method under way, until its result is there."""

    @property
    def every_s(self) -> float:
        """Seconds of work that are worth keeping."""

    def numbered(self, name: str) -> str:
        """The name with a number: the same calls in the same order get the same again."""

    def save(self, name: str, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Keep arrays under a name, in place of those kept before; whole or not at all."""

    def load(self, name: str) -> dict[str, npt.NDArray[Any]] | None:
        """The arrays kept by an earlier attempt at the same result; None if there are none."""


class Kept(Protocol):
    """The result of an item of work: loaded when it is wanted, and only as long."""

    @property
    def digest(self) -> str:
        """Stands for its content."""

    def load(self) -> Any:
        """The artifact."""


@dataclass(frozen=True)
class Item:
    """One of many pieces of work of a stage: an image, a pair of images."""

    name: str
    """For messages."""
    files: tuple[str, ...]
    """Paths that the work reads; they count by what `arguments` say of their content, not by where they lie."""
    arguments: tuple[Any, ...]
    """Texts, numbers, lists of them, and `Kept` results of other items: all that the result depends on."""


class Workers(Protocol):
    """Work in parts that go on together: each sends a message, and all wait for what comes of all messages."""

    def together(
        self,
        work: Callable[[Any, Callable[[Any], Any]], Any],
        parts: Sequence[Any],
        combine: Callable[[list[Any]], list[Any]],
    ) -> list[Any]:
        """The results of `work(part, exchange)` of all parts, in their order.

        Parameters
        ----------
        work : callable
            A function of a module; `exchange(message)` gives the answer to a message. The same part and answers make
            it send the same messages.
        combine : callable
            The answers to the next message of each part, in their order.
        """


class StageContext(Reporter, Protocol):
    """What a running stage talks to."""

    @property
    def checkpoint(self) -> Checkpoint:
        """Where it keeps how far it has come."""

    @property
    def workers(self) -> Workers | None:
        """Who works on parts of it; None: this process."""

    def mapped(self, function: Callable[..., Any], items: Sequence[Item], kind: type[Any], what: str) -> Sequence[Kept]:
        """The results of `function(*files, *arguments)` of many items, in their order.

        Each is kept by its content and never made twice: a stage that was killed, or has one item more, makes what is
        missing. They are made in several processes at once, so that the function is one of a module.

        Parameters
        ----------
        function : callable
            Gives an artifact.
        kind : type
            Of the artifact.
        what : str
            What the items are, for messages: images, pairs.
        """


class NoCheckpoint:
    """A checkpoint that keeps nothing."""

    every_s = float("inf")

    def numbered(self, name: str) -> str:
        """The name."""
        return name

    def save(self, name: str, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Drop the arrays."""

    def load(self, name: str) -> None:  # noqa: ARG002
        """Nothing was kept."""
        return


NO_CHECKPOINT = NoCheckpoint()


@dataclass(frozen=True)
class InMemory:
    """The result of an item that is kept nowhere."""

    digest: str
    artifact: Any

    def load(self) -> Any:
        """The artifact."""
        return self.artifact


class Silent:
    """A context that keeps nothing."""

    checkpoint: Checkpoint = NO_CHECKPOINT
    workers: Workers | None = None

    def log(self, message: str) -> None:
        """Drop the line."""

    def warn(self, message: str) -> None:
        """Drop the line."""

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Drop the figure."""

    def mapped(self, function: Callable[..., Any], items: Sequence[Item], kind: type[Any], what: str) -> list[InMemory]:  # noqa: ARG002
        """Make all of them, one after the other."""
        return [InMemory(item.name, function(*item.files, *map(loaded, item.arguments))) for item in items]


def loaded(argument: Any) -> Any:
    """An argument of an item; the artifact of one that is kept."""
    return argument.load() if hasattr(argument, "load") else argument


SILENT = Silent()


def tell_iteration(
    reporter: Reporter, number: int, cost: float, redundancy: int, decrement: float, damping: float
) -> None:
    """Tell of an iteration of an adjustment: to the log in full, to who waits in one line.

    Parameters
    ----------
    cost : float
        Sum of squares of the weighted residuals before the step.
    decrement : float
        Newton decrement: no unknown moves by more than so many of its standard deviations.
    damping : float
        Of Levenberg and Marquardt; 0 is Gauss-Newton.
    """
    sigma0 = (cost / redundancy) ** 0.5 if redundancy > 0 else float("nan")
    line = f"iteration {number}: sigma0 {sigma0:.4g}, steps up to {decrement:.2g} sigma, damping {damping:.1g}"
    reporter.log(f"{line}, cost {cost:.6f}")
    reporter.progress(number, 0, line)
