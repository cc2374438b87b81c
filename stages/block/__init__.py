"""Role `block`: where a block comes from. () -> Block."""

from aatri.artifacts.block import Block
from aatri.plugin import Role

ROLE = Role(ports={}, kind=Block)
