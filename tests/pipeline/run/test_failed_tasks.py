"""What a failed task hands back to the run that started it."""

import pytest

from aatri.adjustment.openness.open_directions import OpenError
from aatri.errors import Errors, GeometryError, InputError
from aatri.pipeline.run.task import failed


def test_a_narrower_error_of_a_room_comes_back_as_the_class_of_the_tree_that_it_is_of() -> None:
    with pytest.raises(GeometryError, match="leave 1 unknown") as caught:
        failed(OpenError("the observations leave 1 unknown open", remedy="hold it", combinations=())).raise_error()
    assert type(caught.value) is GeometryError
    assert caught.value.remedy == "hold it"


def test_several_errors_come_back_together() -> None:
    both = Errors([InputError("one", where="a.csv:1"), OpenError("two", remedy="", combinations=())])
    with pytest.raises(Errors) as caught:
        failed(both).raise_error()
    assert [type(e) for e in caught.value.errors] == [InputError, GeometryError]
