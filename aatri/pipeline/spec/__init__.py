"""pipeline.yaml: stages, options, overrides."""
