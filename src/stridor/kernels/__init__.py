"""Compiled functions: where their machine code is kept, for which sources, and that it is the same each time.

Every compiled function of stridor is made by the ``njit`` of this module. It takes the options of numba's and differs
from it in two things. What it keeps lies in a folder named after the sources of stridor (numba looks at the file of
the function alone, and would go on with the old code of what the function calls: ``folder``, ``sources``, ``store``).
And the process that compiles runs the same machine code as those that load it (``linking``). Time loops run within
``denormals_flushed``.
"""

from stridor.kernels.compiled import njit
from stridor.kernels.copying import put
from stridor.kernels.denormals import denormals_flushed, flush_denormals
from stridor.kernels.folder import kernel_folder

__all__ = ["denormals_flushed", "flush_denormals", "kernel_folder", "njit", "put"]
