"""From unknowns and records to an index: layout, graph, order of elimination, tree."""
