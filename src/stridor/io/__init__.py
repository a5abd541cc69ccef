"""Results to and from files."""
