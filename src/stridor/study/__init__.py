"""Analyses of a case, one call each, with provenance; later many of them as one dataset."""
