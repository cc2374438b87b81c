"""Content digests of what every variant makes of the film example; as a program it prints them as JSON."""

from __future__ import annotations

import json

import numpy as np

from aatri.errors import AatriError
from aatri.pipeline.methods.registry import find_stages
from aatri.tables.digest import content_digest
from aatri.testing.example_inputs import example_inputs


def digests_of_all() -> dict[str, str]:
    """By variant; those that need options are left out, those that cannot take film give their error."""
    registry, digests = find_stages(), {}
    for name in registry.variants:
        card = registry.card(name)
        if card.options is not None and any(field.is_required() for field in card.options.model_fields.values()):
            continue
        inputs = example_inputs(card.role, registry.role(card.role), "film")
        used = {port.name: inputs[port.name] for port in card.ports if port.name in inputs}
        extras = {"rng": np.random.default_rng(1)} if card.wants_rng else {}
        try:
            digests[name] = content_digest(card.function(**used, **extras))
        except AatriError as error:
            digests[name] = str(error)
    return digests


if __name__ == "__main__":
    print(json.dumps(digests_of_all()))  # noqa: T201
