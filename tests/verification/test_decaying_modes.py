"""Modes that decay are all listed, or it is said which are: vibrations of strong damping may be born of two real roots,
to which no branch leads from where there is no friction."""

from __future__ import annotations

import numpy as np
import pytest

from benches import full_eigenvalues
from random_onsets import belt, determined_up_to
from stridor.modal.over_friction import modes_of_band

pytestmark = pytest.mark.verification

DECAY = 0.5  # of the band: what is promised
EDGE = 1e-6
CLAIMS = ("and all are counted", "that decay at less than")  # of followed branches, and of the full problem's own list


@pytest.mark.parametrize("kind", [1, 2, 3], ids=["light", "of many sizes", "heavy"])
@pytest.mark.parametrize(
    "seeds", [range(16), pytest.param(range(16, 200), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_none_is_left_out(seeds: range, kind: int) -> None:
    judged = 0
    for seed in seeds:
        rng = np.random.default_rng([seed, 5, kind])
        system, top = belt(rng, kind=kind)
        mu = min(float(rng.uniform(0.1, 0.8)), 0.9 * determined_up_to(system))
        values = full_eigenvalues(system, mu)
        values = values[(values.imag >= 0.0) & (np.abs(values) > EDGE * top)]
        found = modes_of_band(system, mu, top / (2 * np.pi))
        if not any(claim in found.completeness[0] for claim in CLAIMS):
            continue
        judged += 1
        listed = found.eigenvalues[0][found.in_band[0]]
        # All that is promised is there, once, and nothing else.
        sure = values[(values.imag <= (1 - EDGE) * top) & (values.real >= -(DECAY - EDGE) * top)]
        for lam in sure:
            near = np.abs(listed - lam) <= 1e-6 * np.abs(lam)
            of_it = np.abs(values - lam) <= 1e-6 * np.abs(lam)
            assert near.sum() == of_it.sum(), f"seed {seed}: {lam:.6g} of {sure}, listed {listed}"
        for lam in listed:
            assert np.abs(values - lam).min() <= 1e-6 * np.abs(lam), f"seed {seed}: {lam:.6g} is none"
    assert judged >= 0.9 * len(seeds)
