"""Studies: many runs to one answer. For now the benchmarks."""
