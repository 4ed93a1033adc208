"""A circuit's files to a graph: names and parameters first (`scope`), then nodes, then connections."""
