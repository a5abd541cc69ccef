"""Bodies to matrices: elements and their assembly. Knows numbers and meshes, no case file."""
