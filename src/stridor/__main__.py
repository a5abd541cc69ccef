"""`python -m stridor`: the program."""

from .app.entry import main

main()
