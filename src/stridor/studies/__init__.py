"""Studies: one case with many values of its numbers, each a row of one store."""
