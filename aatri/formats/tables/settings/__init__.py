"""block.yaml: its keys as validated models, reading with places, writing."""
