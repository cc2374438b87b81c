"""Who joins the parts: their shared unknowns in one dense front, and the totals that all of them go by."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.others import JointSolution, NotInParts, SharedEquations
from aatri.adjustment.threads import one_blas_thread
from aatri.arrays import Float, Int
from aatri.progress import Reporter, tell_iteration


@dataclass(frozen=True)
class Total:
    """Asks for the sum of all parts' numbers."""

    value: float


@dataclass(frozen=True)
class Largest:
    """Asks for the largest of all parts' numbers."""

    value: float


@dataclass(frozen=True)
class First:
    """Asks for the first text of a part that is not empty."""

    text: str


@dataclass(frozen=True)
class SharedCovariance:
    """Asks for the covariance of the shared unknowns."""


@dataclass(frozen=True)
class Failed:
    """Says that a part cannot go on."""

    reason: str


class Top:
    """Answers the messages of all parts, which are of one kind at a time."""

    def __init__(self, redundancy: int, reporter: Reporter) -> None:
        self._redundancy, self._reporter = redundancy, reporter
        self._place: list[Int] = []
        self._factor: Float = np.zeros((0, 0), order="F")
        self._iteration = 0
        self.failed = ""

    def answers(self, messages: list[Any]) -> list[Any]:
        """The answers to the next message of each part."""
        reason = next((m.reason for m in messages if isinstance(m, Failed)), "")
        if not reason and len({type(m) for m in messages}) > 1:
            reason = "parts went different ways"
        if reason:
            return self._stop(messages, reason)
        first = messages[0]
        if isinstance(first, Total):
            return [sum(m.value for m in messages)] * len(messages)
        if isinstance(first, Largest):
            return [max(m.value for m in messages)] * len(messages)
        if isinstance(first, First):
            return [next((m.text for m in messages if m.text), "")] * len(messages)
        with one_blas_thread():
            return self._covariances() if isinstance(first, SharedCovariance) else self._solved(messages)

    def _stop(self, messages: list[Any], reason: str) -> list[Any]:
        self.failed = self.failed or reason
        return [Failed(reason)] * len(messages)

    def _solved(self, messages: list[SharedEquations]) -> list[Any]:
        """The joint solution of the shared unknowns, part by part."""
        cost = sum(m.cost for m in messages)
        if not all(m.regular for m in messages) or not np.isfinite(cost):
            return self._stop(messages, "unknowns of a part are not determined, or its residuals not finite")
        numbers = np.unique(np.concatenate([m.number for m in messages]))
        self._place = [np.searchsorted(numbers, m.number) for m in messages]
        n = len(numbers)
        N, g, diagonal = np.zeros((n, n), order="F"), np.zeros(n), np.zeros(n)
        for m, place in zip(messages, self._place):
            g[place] += m.g
            diagonal[place] += m.diagonal
            for j, first in enumerate(_column_starts(len(place))):
                rows, column = place[j:], m.N[first : first + len(place) - j]
                N[np.maximum(rows, place[j]), np.minimum(rows, place[j])] += column
        N[np.arange(n), np.arange(n)] += messages[0].damping * diagonal
        if n and (lapack.cholesky_panel(N, n) or not (np.diagonal(N) ** 2 > RANK_TOLERANCE * diagonal).all()):
            return self._stop(messages, "unknowns that parts share are not determined")
        y = g.copy()
        lapack.forward(N, y)
        x = y.copy()
        lapack.backward(N, x)
        self._factor = N
        decrease, size = sum(m.decrease for m in messages) + float(y @ y), diagonal * x**2
        twice = sum(float(size[place].sum()) for place in self._place) - float(size.sum())
        self._iteration += 1
        decrement = float(np.sqrt(max(decrease, 0.0)))
        tell_iteration(self._reporter, self._iteration, cost, self._redundancy, decrement, messages[0].damping)
        return [JointSolution(x[place], diagonal[place], cost, decrease, twice) for place in self._place]

    def _covariances(self) -> list[Any]:
        S = lapack.panel_covariance(self._factor, np.zeros((0, 0), order="F")) if len(self._factor) else self._factor
        symmetric = np.tril(S) + np.tril(S, -1).T
        return [symmetric[np.ix_(place, place)] for place in self._place]


def _column_starts(n: int) -> list[int]:
    """Where the columns of a packed lower triangle start."""
    return [j * n - j * (j - 1) // 2 for j in range(n)]


class OthersByMessages:
    """All parts as seen by one, which reaches them by messages."""

    def __init__(self, exchange: Any) -> None:
        self._exchange = exchange

    def _asked(self, message: Any) -> Any:
        answer = self._exchange(message)
        if isinstance(answer, Failed):
            raise NotInParts(answer.reason)
        return answer

    def joined(self, equations: SharedEquations) -> JointSolution:
        """The joint solution."""
        answer: JointSolution = self._asked(equations)
        return answer

    def shared_covariance(self) -> Float:
        """Covariance of the part's shared unknowns from all parts."""
        return np.asarray(self._asked(SharedCovariance()))

    def total(self, value: float) -> float:
        """The sum over all parts."""
        return float(self._asked(Total(value)))

    def largest(self, value: float) -> float:
        """The largest value of a part."""
        return float(self._asked(Largest(value)))

    def first(self, text: str) -> str:
        """The first text that is not empty."""
        return str(self._asked(First(text)))
