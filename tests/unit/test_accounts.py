"""The energy balance and averages over copies from given histories: known answers, in any unit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stridor.temporal import attractor
from stridor.temporal.attractor import Averages, SettledContact, spread
from stridor.temporal.energy import energy_balance


def run(scale: float, **works: list[float]) -> SimpleNamespace:
    """Energies and works of three records in units of ``scale`` joules; works not given are zero."""
    names = ("external", "support", "damping", "friction", "contact")
    return SimpleNamespace(
        kinetic=scale * np.array([1.0, 2.0, 0.5]), elastic=scale * np.array([0.0, 1.0, 2.0]),
        works={name: scale * np.array(works.get(name, [0.0, 0.0, 0.0])) for name in names}
        | {name: scale * np.array(values) for name, values in works.items() if name not in names},
    )  # fmt: skip


@pytest.mark.parametrize("scale", [1e-15, 1.0, 1e9])
def test_what_is_missing_is_told_as_a_share_of_what_was_turned_over(scale: float) -> None:
    # Stored 1, 3, 2.5; put in 3, 5 by load and support, lost 0.5, 3: of 6 at the end 0.5 is missing, of a work of 4.
    balance = energy_balance(run(
        scale, external=[0, 2, 4], support=[0, 0.5, 1], damping=[0, 0.25, 1], friction=[0, 0.2, 1], contact=[0, 0.05, 1],
    ))  # fmt: skip
    assert balance.initial == pytest.approx(scale)
    assert balance.history == pytest.approx(scale * np.array([0, 0, 0.5]), abs=1e-15 * scale)
    assert balance.error == pytest.approx(0.5 / 4)
    assert (balance.kinetic, balance.elastic) == pytest.approx((0.5 * scale, 2 * scale))
    assert (balance.external, balance.support, balance.damping, balance.friction, balance.contact) == pytest.approx(
        (4 * scale, scale, scale, scale, scale)
    )
    assert balance.circulatory is balance.gyroscopic is None


@pytest.mark.parametrize("scale", [1e-15, 1.0])
def test_without_works_the_stored_energy_is_what_was_turned_over(scale: float) -> None:
    balance = energy_balance(run(scale))
    assert balance.error == pytest.approx(2 / 3)
    assert not balance.closes


def test_works_of_skew_matrices_count_as_put_in() -> None:
    balance = energy_balance(run(1.0, circulatory=[0, 2, 1.5], gyroscopic=[0, 0, 0]))
    assert balance.error == pytest.approx(0, abs=1e-15)
    assert balance.closes
    assert (balance.circulatory, balance.gyroscopic) == (1.5, 0)


def test_one_run_alone_has_no_spread(monkeypatch) -> None:
    alone = SettledContact(0.0, 1.0, 12, 20.0, Averages(15.0, 1.0, 2.0, 3.0, 0.2, 0.3, 0.5))
    few = SettledContact(0.0, 1.0, 3, 7.0, Averages(None, 1.0, 2.0, 3.0, 0.2, 0.3, 0.5))
    monkeypatch.setattr(attractor, "settled", lambda run: run)
    found = spread([{"A": alone, "B": few}], 1e-12, 7)  # type: ignore[list-item]
    assert found.mean["A"]["mean_peak_normal_force"] == 15.0
    assert set(found.deviation["A"].values()) == {0.0}
    assert "mean_peak_normal_force" not in found.mean["B"]
    assert found.largest == {"A": (20.0, 20.0), "B": (7.0, 7.0)}
    both = spread([{"A": alone, "B": few}, {"A": few}], 1e-12, 7)  # type: ignore[list-item]
    assert list(both.mean) == ["A"]
    assert both.largest["A"] == (7.0, 20.0)
    assert "mean_peak_normal_force" not in both.mean["A"]
