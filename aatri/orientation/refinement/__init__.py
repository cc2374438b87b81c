"""What image refinement needs: residual fields by collocation, flying heights."""
