"""Results as files: tables of a Solution, its rays as other programs take them."""
