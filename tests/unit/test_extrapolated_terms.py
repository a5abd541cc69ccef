"""How far interpolated matrices are off outside of the ranges they were made for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.modal.parametric.family import FactoredPart, Pieces, extrapolated
from stridor.modal.parametric.problem import Parameter

A = Parameter("a", 1.0, 2.0, value=1.5)


def pieces(power: int) -> Pieces:
    def at(values: Mapping[str, float]) -> Mapping[str, FactoredPart]:
        stiffness = sp.csr_array(np.diag([3.0, 1.0]) * values["a"] ** power)
        mass, nothing = sp.csr_array(np.eye(2)), sp.csr_array((2, 2))
        return {
            "k": FactoredPart(stiffness, "stiffness"), "m": FactoredPart(mass, "mass"),
            "c": FactoredPart(nothing, "damping"),
        }  # fmt: skip

    return at


@pytest.mark.parametrize("power", [0, 1, 2])
def test_polynomials_go_on_as_they_are_also_where_nothing_is_damped(power: int) -> None:
    assert extrapolated(pieces(power), (A,), {"a": 4.0}) < 1e-13


def test_others_are_off_by_a_share_of_the_largest_entry() -> None:
    def at(values: Mapping[str, float]) -> Mapping[str, FactoredPart]:
        beyond = max(values["a"] - 2.0, 0.0)
        return {"k": FactoredPart(sp.csr_array([[2.0 + values["a"] + beyond]]), "stiffness")}

    assert extrapolated(at, (A,), {"a": 3.0}) == pytest.approx(1 / 6)
