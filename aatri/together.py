"""Work in parts that go on together: each sends messages, and all wait for what comes of the messages of all.

A part that is begun anew, as its worker has died, sends the same messages again, and gets the answers it has had before
until it has come to where it was.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from queue import Queue
from typing import Any

Exchange = Callable[[Any], Any]
"""Message -> answer."""

Combine = Callable[[list[Any]], list[Any]]
"""The messages of all parts -> their answers, in the same order."""


MEMORY_OF_WORKER = "AATRI_MEMORY_OF_WORKER"
"""Variable of the environment: bytes that this process may take, where a cluster limits it."""


@dataclass(frozen=True)
class Message:
    """What a part sends."""

    part: int
    attempt: str
    """Which beginning of the part it comes from."""
    number: int
    """Of the messages of this attempt, from 0."""
    content: Any
    last: bool = False
    """Whether the content is the result of the part, or the exception that ended it."""


class Answers:
    """The answers to the messages of all parts.

    Parameters
    ----------
    count : int
        Number of parts.
    answer : callable
        Takes part, attempt and answer.
    """

    def __init__(self, count: int, combine: Combine, answer: Callable[[int, str, Any], None]) -> None:
        self._combine, self._answer = combine, answer
        self._given: list[list[Any]] = [[] for _ in range(count)]
        self._attempts: list[list[str]] = [[] for _ in range(count)]
        self._waiting: dict[int, Any] = {}
        self._error: BaseException | None = None
        self.results: dict[int, Any] = {}

    @property
    def complete(self) -> bool:
        """Whether all parts have their results."""
        return len(self.results) == len(self._given)

    def take(self, message: Message) -> None:
        """Take a message, and answer if all parts wait."""
        k, attempts, answers = message.part, self._attempts[message.part], self._given[message.part]
        if message.attempt not in attempts:
            attempts.append(message.attempt)
        if message.attempt != attempts[-1]:
            return  # from a worker that was given up
        if message.last:
            if isinstance(message.content, BaseException):
                self._error = self._error or message.content
            self.results[k] = message.content
        elif message.number < len(answers):
            self._answer(k, message.attempt, answers[message.number])
            return
        else:
            self._waiting[k] = message.content
        if self._waiting and len(self._waiting) + len(self.results) == len(self._given):
            self._answer_all()

    def all_results(self) -> list[Any]:
        """The results of all parts, in their order; raises what ended one of them."""
        if self._error is not None:
            raise self._error
        return [self.results[k] for k in range(len(self._given))]

    def _answer_all(self) -> None:
        order = sorted(self._waiting)
        messages = [self._waiting[k] for k in order]
        self._waiting.clear()
        answers = [self._error] * len(order) if self._error else self._combine(messages)
        for k, answer in zip(order, answers):
            self._given[k].append(answer)
            self._answer(k, self._attempts[k][-1], answer)


def exchange_by(
    part: int, attempt: str, send: Callable[[Message], None], receive: Callable[[], Any]
) -> tuple[Exchange, Callable[[Any], None]]:
    """What an attempt at a part sends its messages with, and its result."""
    sent = 0

    def exchange(content: Any) -> Any:
        nonlocal sent
        send(Message(part, attempt, sent, content))
        sent += 1
        answer = receive()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    return exchange, lambda result: send(Message(part, attempt, sent, result, last=True))


class Threads:
    """Parts in threads of this process."""

    def together(self, work: Callable[[Any, Exchange], Any], parts: Sequence[Any], combine: Combine) -> list[Any]:
        """The results of all parts, see `progress.Workers`."""
        messages: Queue[Message] = Queue()
        queues: list[Queue[Any]] = [Queue() for _ in parts]
        answers = Answers(len(parts), combine, lambda k, _, answer: queues[k].put(answer))

        def one(k: int) -> None:
            exchange, end = exchange_by(k, "only", messages.put, queues[k].get)
            try:
                end(work(parts[k], exchange))
            except BaseException as error:
                end(error)

        with ThreadPoolExecutor(len(parts)) as pool:
            for k in range(len(parts)):
                pool.submit(one, k)
            while not answers.complete:
                answers.take(messages.get())
        return answers.all_results()
