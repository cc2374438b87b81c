"""What sparse models are recognised by, and what they carry."""

from aatri.formats.nvm.bundler_reader import read_bundler
from aatri.formats.nvm.nvm_reader import read_nvm
from aatri.formats.nvm.nvm_writer import write_nvm
from aatri.formats.parts.format import OF_MODELS, Format, begins

NVM = Format(
    "nvm",
    "VisualSFM NVM",
    begins("NVM_V3"),
    "a first line NVM_V3",
    carries=OF_MODELS,
    page="docs/formats.md#nvm-and-bundler",
    read=read_nvm,
    write=write_nvm,
    written=OF_MODELS,
    estimates_cameras=True,
)
BUNDLER = Format(
    "bundler",
    "Bundler bundle.out",
    begins("# Bundle file v0.3"),
    "a line `# Bundle file v0.3`",
    carries=OF_MODELS,
    page="docs/formats.md#nvm-and-bundler",
    read=read_bundler,
    estimates_cameras=True,
)
