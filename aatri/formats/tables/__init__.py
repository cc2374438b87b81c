"""The block folder, aatri's native input: reader and writer of block.yaml and its CSV tables."""
