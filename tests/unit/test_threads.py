"""Analyses use one BLAS thread, and leave the number as it was."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from stridor.threads import one_thread


def counts() -> set[int]:
    found = [x for x in ThreadpoolController().info() if x["user_api"] == "blas" and "numpy" in x["filepath"]]
    return {x["num_threads"] for x in found}


def test_one_thread_within_and_as_before_after_it() -> None:
    assert np.eye(2).trace() == 2
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        if counts() != {2}:
            pytest.skip("NumPy's BLAS here has one thread in any case")
        assert one_thread(counts)() == {1}
        assert counts() == {2}
        with pytest.raises(KeyError):
            one_thread(lambda: {}["missing"])()
        assert counts() == {2}
