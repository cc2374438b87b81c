"""Role `strip_formation`: models joined to free strips. block, models -> Strips."""

from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.plugin import Role

ROLE = Role(ports={"block": Block, "models": Models}, kind=Strips)
