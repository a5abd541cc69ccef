"""Methods of time stepping, each a folder with the contract of `temporal.stepper`."""
