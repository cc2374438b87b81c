"""From one iteration to the next: damping, robust weights, linearity, blocks that run away."""
