"""SOCET SET and SOCET GXP: ground and image points."""
