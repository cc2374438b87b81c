"""The frame of the adjustment: blocks and solutions into it and back."""
