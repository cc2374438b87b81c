"""An adjustment that is killed goes on at the iteration it had come to, to the same bits."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import pytest

from aatri.progress import Silent
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.tables.digest import content_digest
from tests.stages.chain import run_chain, simulated

OPTIONS: dict[str, Any] = {"self_calibration": {"set": "brown_conrady"}}


@dataclass
class Files:
    """What is kept of a stage, whatever becomes of the process."""

    every_s: float = 0.0
    saved: dict[str, Any] = field(default_factory=dict)
    numbers: Counter[str] = field(default_factory=Counter)

    def numbered(self, name: str) -> str:
        self.numbers[name] += 1
        return f"{name}-{self.numbers[name]}"

    def save(self, name: str, arrays: Any) -> None:
        self.saved[name] = {key: values.copy() for key, values in arrays.items()}

    def load(self, name: str) -> Any:
        return self.saved.get(name)


class Mortal(Silent):
    """A context that is killed after so many iterations."""

    def __init__(self, checkpoint: Files, last: int = 1_000_000) -> None:
        self.checkpoint, self.last, self.told = checkpoint, last, 0

    def progress(self, done: int, total: int, what: str = "") -> None:
        self.told += 1
        if self.told > self.last:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def chain() -> Any:
    block = simulated(
        4, preset="uav", flight={"strips": 2, "images_per_strip": 5}, known={"full": 5}, ties={"random_per_image": 60.0}
    )
    return run_chain(block)


def _bundle(chain: Any, context: Any) -> Any:
    return bundle(chain.block, chain.refined, chain.absolute, options=BundleOptions(**OPTIONS), context=context)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("share", [0.3, 0.8])
def test_what_is_killed_goes_on_to_the_same_bits(chain: Any, share: float) -> None:
    whole = Mortal(Files(float("inf")))
    expected = content_digest(_bundle(chain, whole))
    killed = Mortal(Files(), round(share * whole.told))
    with pytest.raises(KeyboardInterrupt):
        _bundle(chain, killed)
    assert killed.checkpoint.saved
    again = Mortal(Files(saved=killed.checkpoint.saved))
    assert content_digest(_bundle(chain, again)) == expected
    assert again.told < whole.told


def test_what_was_kept_of_another_start_is_not_taken(chain: Any) -> None:
    files = Files()
    expected = content_digest(_bundle(chain, Mortal(files)))
    for kept in files.saved.values():
        kept["start"] = kept["start"][::-1].copy()
        kept["hold"] = kept["hold"] + 1.0
    assert content_digest(_bundle(chain, Mortal(Files(saved=files.saved)))) == expected
