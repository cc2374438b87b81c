"""Parts that go on together: their messages, and parts that are begun anew."""

from __future__ import annotations

from typing import Any

import pytest

from aatri.together import Answers, Message, Threads


def _sum(messages: list[int]) -> list[int]:
    return [sum(messages)] * len(messages)


def test_all_parts_get_what_comes_of_all() -> None:
    def work(part: int, exchange: Any) -> list[int]:
        return [exchange(part), exchange(10 * part)]

    assert Threads().together(work, [1, 2, 3], _sum) == [[6, 60]] * 3


def test_what_ends_one_part_ends_all() -> None:
    def work(part: int, exchange: Any) -> int:
        if part == 2:
            raise ValueError("not this one")
        return int(exchange(part))

    with pytest.raises(ValueError, match="not this one"):
        Threads().together(work, [1, 2, 3], _sum)


def test_a_part_begun_anew_is_told_again_what_it_was_told() -> None:
    told: list[tuple[int, str, Any]] = []
    asked: list[list[Any]] = []

    def combine(messages: list[Any]) -> list[Any]:
        asked.append(messages)
        return _sum(messages)

    answers = Answers(2, combine, lambda *answer: told.append(answer))
    for message in (Message(0, "a", 0, 1), Message(1, "b", 0, 2), Message(0, "a", 1, 3)):
        answers.take(message)
    assert told == [(0, "a", 3), (1, "b", 3)]
    answers.take(Message(1, "c", 0, 2))  # b's worker has died before its next message
    assert told[2:] == [(1, "c", 3)]
    answers.take(Message(1, "b", 1, 99))  # or was only slow
    answers.take(Message(1, "c", 1, 4))
    assert told[3:] == [(0, "a", 7), (1, "c", 7)]
    assert asked == [[1, 2], [3, 4]]
    answers.take(Message(1, "c", 2, "one", last=True))
    assert not answers.complete
    answers.take(Message(0, "a", 2, "other", last=True))
    assert answers.complete
    assert answers.all_results() == ["other", "one"]
