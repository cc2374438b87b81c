"""Drawings as SVG: axes, charts, the plan of a block, residuals."""
