"""Role `fiducial_marks`: the fiducial marks of scanned film, measured in its pixels. block -> Block."""

from aatri.artifacts.block import Block
from aatri.plugin import Role

ROLE = Role(ports={"block": Block}, kind=Block)
