"""Unknown parameters of cameras: of a block, of another block that calibrates it, and in the tables of a Solution."""
