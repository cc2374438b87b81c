"""What the verbs print and how: data, narration, live bars, tables of values and of runs."""
