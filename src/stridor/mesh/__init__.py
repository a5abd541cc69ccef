"""Meshes of solid bodies: built-in shapes, files, and what a mesh must be to be computed with."""
