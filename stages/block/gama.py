"""GNU Gama's networks: an input file of gama-local (XML, *.gkf), a block without images.

Distances, directions, angles, azimuths, zenith angles, height differences, vectors with their covariances, observed
coordinates with theirs. `bundle_adjustment/bundle` adjusts it, `from: {block}`; a free network, whose points are
adjusted in capitals, with `datum: free, datum_over: marked`. The m0 of gama is `sigma-apr` times sigma0.
"""

from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import screened
from aatri.formats.edits.edited import edited
from aatri.formats.gama.reader import read_gama
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import EditOptions


class GamaOptions(EditOptions):
    """Options of block/gama."""

    path: InputPath = Field(description="the network, an input file of gama-local")


@stage(version=1, uses=())
def gama(*, options: GamaOptions, context: Context = SILENT) -> Block:
    """Read a network of GNU Gama."""
    block = edited(read_gama(options.path, context), options.edits, context)
    return screened(block, context, 0.0)
