"""What workers need before their first row: imported in the process that they are forked off, so that none has to."""

import gc

from ..kernels import denormals_flushed
from . import workers

__all__ = ["workers"]

with denormals_flushed():
    pass  # with the first kernel, whichever, numba sets up what all need: a third of a second
gc.freeze()  # none of it is garbage: workers need not look at it
