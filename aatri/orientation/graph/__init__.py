"""Images oriented from the graph of their pairs: any arrangement, no order, no start values."""
