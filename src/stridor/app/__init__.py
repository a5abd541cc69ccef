"""The program: parse, call the API, show."""
