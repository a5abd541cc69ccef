"""What a saved reduced model may lack: its full matrices, its basis too."""

from __future__ import annotations

from typing import Literal, NoReturn

from ..errors import AnalysisError
from ..modal.parametric import ReducedModel

Keep = Literal["all", "shapes", "eigenvalues"]
KEEPS: tuple[Keep, ...] = ("all", "shapes", "eigenvalues")


def kept_in(model: ReducedModel) -> Keep:
    """What a model holds: one read from a file may lack its basis and the full matrices."""
    if isinstance(model.vectors, LeftOut):
        return "eigenvalues"
    return "shapes" if any(isinstance(t.matrix, LeftOut) for t in model.problem.terms) else "all"


class LeftOut:
    """Stands where a file has left something out: knows its shape, and tells whoever would compute with it."""

    __array_ufunc__ = None

    def __init__(self, what: str, shape: tuple[int, int], nnz: int) -> None:
        self.what, self.shape, self.nnz = what, shape, nnz

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        self._refuse()

    def _refuse(self, *_: object) -> NoReturn:
        raise AnalysisError(
            f"{self.what} left out when this reduced model was saved; make it again, or save it with "
            'keep="all" (stridor reduce --keep all)'
        )

    __matmul__ = __rmatmul__ = __mul__ = __rmul__ = __truediv__ = __neg__ = __abs__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = __getitem__ = __array__ = __len__ = __iter__ = _refuse
