"""The energy balance and averages over copies from given histories: known answers, in any unit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stridor.temporal import attractor
from stridor.temporal.attractor import Averages, SettledContact, spread
from stridor.temporal.energy import CLOSED, EnergyBalance, energy_balance


def run(scale: float, **works: list[float]) -> SimpleNamespace:
    """Energies and works of three records in units of ``scale`` joules; works not given are zero."""
    names = ("external", "support", "damping", "friction", "contact")
    return SimpleNamespace(
        record_every=1,
        kinetic=scale * np.array([1.0, 2.0, 0.5]), elastic=scale * np.array([0.0, 1.0, 2.0]),
        works={name: scale * np.array(works.get(name, [0.0, 0.0, 0.0])) for name in names}
        | {name: scale * np.array(values) for name, values in works.items() if name not in names},
    )  # fmt: skip


@pytest.mark.parametrize("scale", [1e-15, 1.0, 1e9])
def test_what_is_missing_is_told_as_a_share_of_what_was_turned_over(scale: float) -> None:
    # Stored 1, 3, 2.5; put in 3, 5 by load and support, lost 0.5, 3: of 6 at the end 0.5 is missing, of a work of 4 and of motions of 1.5.
    balance = energy_balance(run(
        scale, external=[0, 2, 4], support=[0, 0.5, 1], damping=[0, 0.25, 1], friction=[0, 0.2, 1], contact=[0, 0.05, 1],
    ))  # fmt: skip
    assert balance.initial == pytest.approx(scale)
    assert balance.history == pytest.approx(scale * np.array([0, 0, 0.5]), abs=1e-15 * scale)
    assert balance.error == pytest.approx(0.5 / 4)
    assert balance.vibration_error == pytest.approx(0.5 / 1.5)
    assert (balance.kinetic, balance.elastic) == pytest.approx((0.5 * scale, 2 * scale))
    assert (balance.external, balance.support, balance.damping, balance.friction, balance.contact) == pytest.approx(
        (4 * scale, scale, scale, scale, scale)
    )
    assert balance.circulatory is balance.gyroscopic is None


@pytest.mark.parametrize("scale", [1e-15, 1.0])
def test_without_works_the_stored_energy_is_what_was_turned_over(scale: float) -> None:
    """Of which only what changes: 2 of deformation, of which all is missing."""
    balance = energy_balance(run(scale))
    assert balance.error == pytest.approx(2 / 2)
    assert not balance.closes


def test_a_preload_turns_nothing_over() -> None:
    """What lies there from the first record on hides no vibration of a billionth of it, nor does its rounding."""
    swing = np.array([0.0, 1.0, 0.0, 1.0, 0.0])
    works = {name: np.zeros(5) for name in ("external", "support", "damping", "friction", "contact")}

    def balance(kinetic: float, preload: float = 1e9, friction: float = 0.0) -> EnergyBalance:
        moved = {"support": friction * np.arange(5), "friction": friction * np.arange(5)}
        return energy_balance(SimpleNamespace(
            record_every=1, kinetic=kinetic * swing, elastic=preload + 1 - swing, works=works | moved,
        ))  # type: ignore[arg-type]  # fmt: skip

    assert balance(1.0).closes
    assert balance(2.0).error == pytest.approx(1 / 2)
    assert not balance(2.0).closes
    # Beside the work of sliding it is a billionth, and still all of the vibration.
    assert balance(1.0, friction=1e9).closes
    rubbed = balance(2.0, friction=1e9)
    assert rubbed.error < CLOSED
    assert rubbed.vibration_error == pytest.approx(1 / 2)
    assert not rubbed.closes
    assert rubbed.words(0.5).endswith("2.5e-10 of the energy turned over is missing, 5.0e-01 of that of the vibration")
    # With more preload than digits what vibrates cannot be told from rounding, which is said.
    hidden = balance(2.0, preload=1e14, friction=1e9)
    assert hidden.closes
    assert hidden.words(0.5).endswith("to rounding, beside which the vibration has too little energy to be checked")
    still = balance(1e-3, preload=1e14)
    assert still.closes
    assert still.words(0.5) == "energy balance closes to rounding, beside which next to no energy is turned over"


def test_works_of_skew_matrices_count_as_put_in() -> None:
    balance = energy_balance(run(1.0, circulatory=[0, 2, 1.5], gyroscopic=[0, 0, 0]))
    assert balance.error == pytest.approx(0, abs=1e-15)
    assert balance.closes
    assert (balance.circulatory, balance.gyroscopic) == (1.5, 0)


def test_one_run_alone_has_no_spread(monkeypatch) -> None:
    alone = SettledContact(0.0, 1.0, 12, 20.0, Averages(15.0, 1.0, 2.0, 3.0, 0.2, 0.3, 0.5))
    few = SettledContact(0.0, 1.0, 3, 7.0, Averages(None, 1.0, 2.0, 3.0, 0.2, 0.3, 0.5))
    monkeypatch.setattr(attractor, "settled_contacts", lambda run: run)
    found = spread([{"A": alone, "B": few}], 1e-12, 7)  # type: ignore[list-item]
    assert found.mean["A"]["mean_peak_normal_force"] == 15.0
    assert set(found.deviation["A"].values()) == {0.0}
    assert "mean_peak_normal_force" not in found.mean["B"]
    assert found.largest == {"A": (20.0, 20.0), "B": (7.0, 7.0)}
    both = spread([{"A": alone, "B": few}, {"A": few}], 1e-12, 7)  # type: ignore[list-item]
    assert list(both.mean) == ["A"]
    assert both.largest["A"] == (7.0, 20.0)
    assert "mean_peak_normal_force" not in both.mean["A"]
