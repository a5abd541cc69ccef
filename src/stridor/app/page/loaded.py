"""What processes of pages and of runs compute with: imported in the process that they are forked off, so that a page is
there seconds earlier and holds what all share once."""

import gc

from ...kernels import denormals_flushed
from ...study import analyses
from . import bench, mode_data, running

__all__ = ["analyses", "bench", "mode_data", "running"]

with denormals_flushed():
    pass  # with the first kernel, whichever, numba sets up what all need
gc.freeze()  # none of it is garbage: pages need not look at it
