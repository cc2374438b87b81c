"""A single stage called in memory: artifacts in, one artifact out, nothing written."""

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aatri.api.blocks import Warned
from aatri.api.frames import html_table
from aatri.errors import SpecError, raise_all
from aatri.ids import did_you_mean, several
from aatri.plugin import Context, StageCard
from aatri.tables.schema import Artifact


class StageCall:
    """A method that is called with its inputs by port, and its options by name; see `stage_call`."""

    def __init__(self, card: StageCard) -> None:
        self._card = card
        self.__doc__ = card.doc

    @property
    def ports(self) -> dict[str, str]:
        """The kinds of artifact it takes, by port."""
        return {port.name: port.kind.kind for port in self._card.ports}

    @property
    def options(self) -> dict[str, Any]:
        """Its options with their defaults; `...` where one must be given."""
        fields = self._card.options.model_fields if self._card.options else {}
        return {name: ... if about.is_required() else about.get_default() for name, about in fields.items()}

    def __call__(
        self, *inputs: Artifact, seed: int = 1, context: Context | None = None, **named: Artifact | Any
    ) -> Artifact:
        """Make the stage.

        Parameters
        ----------
        *inputs : Artifact
            In the order of the ports.
        seed : int
            Of its random numbers, where it has any.
        context : Context, optional
            Is told what it logs, warns of and how far it is. By default warnings are Python's, and no more is told.
        **named
            Inputs by port, and options as pipeline.yaml has them.

        Raises
        ------
        SpecError
            If an input is missing, or there is no such port or option, or its value is wrong.
        AatriError
            What the method refuses.
        """
        import numpy as np

        ports = list(self.ports)
        artifacts = dict(zip(ports, inputs)) | {name: named.pop(name) for name in ports if name in named}
        wrong = [
            f"{port.name} is {type(artifacts[port.name]).__name__}, not {port.kind.kind}"
            if port.name in artifacts
            else f"needs {port.name}, a {port.kind.kind}"
            for port in self._card.ports
            if not isinstance(artifacts.get(port.name), port.kind)
            and not (port.optional and port.name not in artifacts)
        ]
        if len(inputs) > len(ports):
            wrong.append(f"takes {several(len(ports), 'input')}, not {len(inputs)}")
        raise_all([SpecError(text, where=self._card.name) for text in wrong])
        extras: dict[str, Any] = {"context": context or Warned()} if self._card.wants_context else {}
        if self._card.wants_rng:
            extras["rng"] = np.random.default_rng(seed)
        if self._card.options is not None:
            extras["options"] = self._options(named)
        elif named:
            raise SpecError(f"unknown option {next(iter(named))!r}; it takes none", where=self._card.name)
        return self._card.function(**artifacts, **extras)

    def _options(self, named: Mapping[str, Any]) -> Any:
        model = self._card.options
        assert model is not None
        unknown = [name for name in named if name not in model.model_fields]
        if unknown:
            hint = did_you_mean(unknown[0], [*self.ports, *model.model_fields])
            raise SpecError(f"unknown option {unknown[0]!r}{hint}", where=self._card.name)
        try:
            return model.model_validate(dict(named), context={"base": Path.cwd(), "runs_code": True})
        except ValidationError as error:
            raise_all([SpecError(_told(dict(e)), where=self._card.name) for e in error.errors(include_url=False)])

    def __repr__(self) -> str:
        ports = ", ".join(f"{port.name}: {port.kind.kind}{'?' * port.optional}" for port in self._card.ports)
        return f"<{self._card.name}({ports}) -> {self._card.kind.kind}>"

    def _repr_html_(self) -> str:
        fields = self._card.options.model_fields if self._card.options else {}
        rows = [(name, self.options[name], about.description or "") for name, about in fields.items()]
        return html_table(
            ("option", "default", ""), rows, caption=f"{self!r}: {inspect.cleandoc(self._card.doc).splitlines()[0]}"
        )


def _told(fault: dict[str, Any]) -> str:
    """What is wrong with an option, or with several together."""
    name, message = ".".join(map(str, fault["loc"])), str(fault["msg"]).removeprefix("Value error, ")
    value = "" if isinstance(fault["input"], dict) else f" is {fault['input']!r}"
    return f"option {name}{value}: {message}" if name else message


def stage_call(name: str, local: str | Path | None = None) -> StageCall:
    """A method to be called in memory.

    Parameters
    ----------
    name : str
        ROLE/VARIANT, see `aatri stages`.
    local : str or Path, optional
        A project's own folder of stages; runs its code.

    Raises
    ------
    PluginError
        If there is none of this name.

    Examples
    --------
    >>> bundle = stage_call("bundle_adjustment/bundle")
    >>> bundle.ports["block"], bundle.options["reliability"]
    ('Block', False)
    """
    from aatri.cli.arguments.planning import compilation_of
    from aatri.cli.terminal.compiling import wait_for
    from aatri.cli.terminal.console import is_terminal, narrate
    from aatri.pipeline.methods.catalogue import Catalogue
    from aatri.pipeline.methods.registry import find_stages

    folder = Path(local) if local is not None else None
    compilation = compilation_of([name], Catalogue(folder))
    if compilation is not None:
        wait_for(compilation, narrate, terminal=is_terminal())
    return StageCall(find_stages(folder).card(name))
