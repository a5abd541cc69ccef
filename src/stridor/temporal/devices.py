"""Where an ensemble runs: on the cores of this machine, or on a GPU. numba's CUDA is loaded only to look for one."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from numba.core import config as _config

from ..errors import AnalysisError, CaseError

DEVICES = ("auto", "cpu", "gpu")
ENOUGH = 64  # runs side by side from which "auto" takes a GPU: fewer blocks than that leave most of one idle
INSTALL = "pip install 'stridor[gpu]'"


@dataclass(frozen=True)
class Gpu:
    """A GPU that numba can compile for and start blocks on: its name and free memory [bytes]."""

    name: str
    free: float


def simulated() -> bool:
    """Whether numba's simulator stands in for a GPU (NUMBA_ENABLE_CUDASIM=1)."""
    settings: Any = _config
    return bool(settings.ENABLE_CUDASIM)


def gpu() -> Gpu | str:
    """The GPU that is there, else what is missing and how to mend it."""
    if not simulated() and find_spec("numba_cuda") is None:
        return f"numba-cuda, which is not installed: {INSTALL} (Linux, NVIDIA)"
    try:
        from numba import cuda as target

        cuda: Any = target
        if not cuda.is_available():
            return _missing(cuda)
        if simulated():
            return Gpu("CUDA simulator", float("inf"))
        context = cuda.current_context()
        name, free = context.device.name, float(context.get_memory_info()[0])
    except Exception as error:  # of many kinds, by what fails: package, driver, device
        return f"a GPU that CUDA can use, which fails here: {first_line(error)}"
    return Gpu(name.decode() if isinstance(name, bytes) else str(name), free)


def _missing(cuda: Any) -> str:
    """Why numba says that CUDA is not available."""
    error = cuda.cuda_error()
    if error:
        return f"an NVIDIA GPU and its driver: {first_line(error)} (nvidia-smi lists what the driver sees)"
    return f"the compiler of CUDA beside its driver: {INSTALL}"


def first_line(error: object) -> str:
    """The first line that says something."""
    lines = [line.strip() for line in str(error).splitlines()]
    telling = [line for line in lines if line and not line.endswith(":")]
    return telling[0].rstrip(".") if telling else type(error).__name__


def place(device: str, members: int) -> tuple[Gpu | None, str]:
    """The GPU that so many runs side by side take, or None, and what to say about that: with "auto" few runs, and any
    where `stridor[gpu]` is not installed, take the cores without a word.

    Raises CaseError for a word that is none of ``DEVICES``, AnalysisError where a GPU is asked for and cannot be had.
    """
    if device not in DEVICES:
        raise CaseError("device", device, "auto, cpu or gpu")
    if device == "cpu" or (device == "auto" and simulated()):
        return None, ""
    if device == "auto" and (members < ENOUGH or find_spec("numba_cuda") is None):
        return None, ""
    found = gpu()
    if isinstance(found, str):
        if device == "auto":
            return None, f"on the CPU, as a GPU needs {found}"
        raise AnalysisError(f"a run on a GPU needs {found}; without one: device auto or cpu")
    return found, ""
