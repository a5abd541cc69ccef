"""Contacts with friction of their own beside one another: a contact given none has none at any μ asked for.

The truth is put together here, on dense matrices from the rows of the contacts: each contact has its own coefficient.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sl

import stridor as st
from stridor.case import Case, loads
from stridor.errors import CaseError
from stridor.periodic.harmonic.balance import scales
from stridor.periodic.harmonic.birth import small_motion, still
from stridor.periodic.harmonic.problem import HarmonicFamily
from stridor.periodic.problem import why_not_shooting
from stridor.system import System

# A pad on a moving belt; a wall on its right holds it, along which nothing moves it; a shoe presses on it from above.
TEXT = """
materials.soft = { young_modulus = 4e9, density = 2500.0, poisson_ratio = 0.3 }
materials.hard = { young_modulus = 60e9, density = 2500.0, poisson_ratio = 0.3 }
[bodies.belt]
type = "solid"
material = "hard"
model = "plane strain"
thickness = 0.01
mesh = { shape = "rectangle", corner = [-0.02, -0.01], size = [0.08, 0.01], divisions = [8, 1], cells = "quad" }
[bodies.pad]
type = "solid"
material = "soft"
model = "plane strain"
thickness = 0.01
mesh = { shape = "rectangle", corner = [0.0, 0.0], size = [0.03, 0.015], divisions = [3, 2], cells = "quad" }
damping = { mass = 5.0, stiffness = 1e-8 }
[bodies.wall]
type = "obstacle"
shape = "flat"
point = [0.03, 0.0]
normal = [-1.0, 0.0]
[bodies.shoe]
type = "solid"
material = "hard"
model = "plane strain"
thickness = 0.01
mesh = { shape = "rectangle", corner = [-0.01, -0.025], size = [0.05, 0.015], divisions = [4, 1], cells = "quad" }
[supports.drive]
at = "belt.right"
fixed = ["x", "y"]
velocity = { x = 0.5 }
[supports.ground]
at = "shoe.left"
fixed = ["x", "y"]
[loads.press]
at = "pad.top"
pressure = 2e5
[loads.push]
at = "pad.left"
pressure = 3e5
[contacts.rub]
slave = "pad.bottom"
master = "belt.top"
stiffness = 5e12
friction = { law = "coulomb", coefficient = 0.4 }
[contacts.back]
slave = "belt.bottom"
master = "shoe.top"
stiffness = 5e12
friction = { law = "coulomb", coefficient = 0.0 }
[contacts.guide]
slave = "pad.right"
master = "wall"
stiffness = 5e12
friction = { law = "coulomb", coefficient = 0.0 }
[[phases]]
name = "slide"
duration = 2e-5
[temporal]
initial = "steady-sliding"
[modal]
friction_range = [0.0, 1.0]
max_frequency_hz = 60e3
modes = 200
"""
BACK = "contacts.back.friction.coefficient"


def pushes(system: System, mu: dict[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the gaps, of what normal forces push, and contact stiffness of every node."""
    nodes = system.contact_nodes()
    slip = nodes.slip_velocity(system.motion.full)[:, 0]
    own = np.array([mu[nodes.names[k]] for k in nodes.owner])
    normal = nodes.normal.toarray()
    return normal, normal - (own * np.sign(slip))[:, None] * nodes.tangent.toarray(), 1.0 / nodes.compliance


def sliding(
    system: System, mu: dict[str, float], held: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Normal forces of steady sliding with the nodes that touch there, or those ``held``, and stiffness with them."""
    normal, push, spring = pushes(system, mu)
    k = system.stiffness.toarray()
    force = sum(system.loads.values()) - system.motion.damping @ system.motion.full
    touch = np.ones(len(spring), dtype=bool) if held is None else held
    for _ in range(50):
        stiff = k + (push * (touch * spring)[:, None]).T @ normal
        gap = normal @ np.linalg.solve(stiff, force - push.T @ (touch * spring * system.contact_nodes().gap))
        gap = gap + system.contact_nodes().gap
        before, touch = touch, gap < 0.0 if held is None else held
        if np.array_equal(before, touch):
            break
    return np.where(touch, -spring * gap, 0.0), stiff


def truth(system: System, mu: dict[str, float], held: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Normal forces of steady sliding, and eigenvalues of the nodes that touch there, or of those ``held``."""
    forces, stiff = sliding(system, mu, held)
    m, c = system.mass.toarray(), system.damping.toarray()
    n = len(m)
    inverse = np.linalg.inv(m)
    whole = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiff, -inverse @ c]])
    return forces, sl.eigvals(whole)


def growing(system: System, touching: np.ndarray | None = None, highest: float = 60e3, **mu: float) -> int:
    """How many modes of the band grow."""
    values = truth(system, mu, touching)[1]
    band = (np.abs(values) < 2 * np.pi * highest) & (values.imag >= 0)
    return int(np.sum(band & (values.real > 1e-10 * np.abs(values))))


def agree(found: st.ComplexModes, values: np.ndarray, highest: float) -> None:
    """The same oscillating modes in a band."""
    own = found.eigenvalues[0]
    own = own[np.isfinite(own) & (own.imag > 0) & (np.abs(own) < 2 * np.pi * highest)]
    others = values[(values.imag > 0) & (np.abs(values) < 2 * np.pi * highest)]
    assert len(own) == len(others) > 3
    for value in others:
        assert np.abs(own - value).min() < 1e-7 * abs(value)


def with_friction(**given: float) -> Case:
    return loads(TEXT).with_({f"contacts.{name}.friction.coefficient": mu for name, mu in given.items()})


@functools.cache
def true_of(mu: float) -> tuple[np.ndarray, np.ndarray]:
    """`truth` with this friction where the case has some."""
    return truth(st.build_system(with_friction()), {"rub": mu, "back": 0.0, "guide": 0.0})


@functools.cache
def onsets_of_the_case() -> st.Onsets:
    return st.onsets(with_friction())


@functools.cache
def own_friction(source: str) -> list[float]:
    """At which μ modes are sought that are asked for without one."""
    return st.modes(with_friction().with_({"modal.source": source})).mu.tolist()


@pytest.mark.parametrize("mu", [0.0, pytest.param(0.3, marks=pytest.mark.slow), 0.7])
@pytest.mark.parametrize("source", ["krylov", "reduced", "full"])
def test_a_contact_given_no_friction_has_none_at_any_coefficient(mu: float, source: str) -> None:
    case = with_friction().with_({"modal.source": source})
    system, found = st.build_system(case), st.steady_sliding(case, mu)
    forces, values = true_of(mu)
    assert found.normal_force == pytest.approx(forces, rel=1e-8, abs=1e-8 * forces.max())
    nodes = system.contact_nodes()
    for k, name in enumerate(nodes.names):
        mine = nodes.owner == k
        ratio = np.abs(found.friction_force[mine]).sum() / found.normal_force[mine].sum()
        assert ratio == pytest.approx(mu if name == "rub" else 0.0)
    agree(st.modes(case, mu), values, 55e3)
    assert own_friction(source) == [0.4]


def test_onsets_over_mu_are_those_of_the_contacts_with_friction() -> None:
    system, found = st.build_system(with_friction()), onsets_of_the_case()
    assert len(found.onsets) > 3

    for mu in {o.mu for o in found.onsets}:
        expected = sum(-1 if o.stabilising else 1 for o in found.onsets if o.mu == mu)
        below, above = (growing(system, rub=mu * f, back=0.0, guide=0.0) for f in (1 - 1e-4, 1 + 1e-4))
        assert above - below == expected, mu
    assert growing(system, rub=1.0, back=0.0, guide=0.0) == sum(-1 if o.stabilising else 1 for o in found.onsets)


def test_growth_that_leaves_the_band_where_other_nodes_touch_and_comes_back_is_listed_once() -> None:
    case, top = with_friction(), 25808.0
    system, found = st.build_system(case), st.onsets(case, (0.0, 0.7), max_frequency_hz=top)
    later = st.onsets(case, (0.0, 0.8), max_frequency_hz=top)
    (border,) = {o.mu for o in found.onsets if o.kind == "contact"}
    # At the border one mode jumps in frequency, from below the top to above it, and grows on both sides.
    sides = [truth(system, {"rub": border * f, "back": 0.0, "guide": 0.0})[1] for f in (1 - 1e-6, 1 + 1e-6)]
    before, after = (v[np.argmin(np.abs(v - 2j * np.pi * 25800.0))] for v in sides)
    assert abs(before) < 2 * np.pi * top < abs(after)
    assert before.real > 100.0
    assert after.real > 100.0
    # In the range up to 0.7 it is above the band at the end, up to 0.8 it is in it again.
    first = found.onsets[0].mu
    assert [sum(abs(o.mu - first) < 1e-6 for o in which.onsets) for which in (found, later)] == [1, 1]
    assert not any(o.stabilising and abs(o.frequency_hz - 25800.0) < 50.0 for o in later.onsets)
    assert growing(system, highest=top, rub=0.8, back=0.0, guide=0.0) == sum(
        -1 if o.stabilising else 1 for o in later.onsets
    )
    said = [n for n in later.notes if n.startswith("The growth that begins")]
    assert len(said) == 1
    assert said[0].startswith(f"The growth that begins at μ = {first:.6g}, {found.onsets[0].frequency_hz:.1f} Hz, leaves")
    assert f"upwards at μ = {border:.6g}, where other nodes touch, goes on above it and comes back at" in said[0]
    enters = float(said[0].rpartition("≈ ")[2].rstrip("."))
    counts = [growing(system, highest=top, rub=mu, back=0.0, guide=0.0) for mu in (enters - 0.02, enters + 0.02)]
    assert counts[1] == counts[0] + 1


def test_a_reduced_model_over_mu_leaves_frictionless_contacts_without() -> None:
    for changes in ({}, {"modal.prestress": True}):
        case = with_friction().with_(changes)
        model = st.reduced_model(case, {"mu": (0.0, 0.5)}, max_frequency_hz=60e3)
        exact = st.modes(case, 0.35, max_frequency_hz=60e3).eigenvalues[0]
        found = model.modes({"mu": 0.35}).values
        exact = exact[(exact.imag > 0) & (np.abs(exact) < 2 * np.pi * 55e3)]
        assert len(exact) > 3
        for value in exact:
            assert np.abs(found - value).min() < 1e-6 * abs(value)
        values = truth(st.build_system(case), {"rub": 0.35, "back": 0.0, "guide": 0.0})[1]
        if not changes:
            assert max(np.abs(values - value).min() / abs(value) for value in exact) < 1e-7


@pytest.mark.parametrize("stepper", ["explicit", "implicit"])
def test_a_run_at_a_coefficient_leaves_frictionless_contacts_without(stepper: str) -> None:
    changes = {"temporal.stepper": stepper, "contacts.rub.friction.coefficient": 0.25}
    scaled = st.simulate(with_friction().with_({"temporal.stepper": stepper}), 0.25)
    own = st.simulate(with_friction().with_(changes))
    assert np.array_equal(scaled.normal_force, own.normal_force)
    assert np.array_equal(scaled.tangential_force, own.tangential_force)
    assert np.abs(scaled.tangential_force).max() > 0.2 * np.abs(scaled.normal_force).max() > 0.0


def test_modes_without_a_coefficient_are_those_of_each_contact_s_own() -> None:
    case = with_friction(back=0.1)
    system = st.build_system(case)
    forces, values = truth(system, {"rub": 0.4, "back": 0.1, "guide": 0.0})
    assert st.steady_sliding(case).normal_force == pytest.approx(forces, rel=1e-8, abs=1e-8 * forces.max())
    found = st.modes(case)
    agree(found, values, 55e3)
    assert any("each contact has its own friction coefficient (rub 0.4, back 0.1)" in note for note in found.notes)
    # Over μ both have the same, which is said.
    same = st.modes(case, 0.4)
    agree(same, truth(system, {"rub": 0.4, "back": 0.4, "guide": 0.0})[1], 55e3)
    said = "to which the case gives different ones (rub 0.4, back 0.1), so that their ratios do not count here; "
    for notes in (same.notes, st.onsets(case).notes, st.steady_sliding(case, 0.4).warnings):
        assert sum(said in note for note in notes) == 1
    for notes in (found.notes, st.steady_sliding(case).warnings, onsets_of_the_case().notes):
        assert not any(said in note for note in notes)
    for refused in (lambda: st.compare(case, only=["growth"]), lambda: st.pencil(case)):
        with pytest.raises(CaseError, match=r"name it .*`simulate` without μ answer with each contact's own"):
            refused()


def test_a_run_says_that_its_coefficient_takes_the_place_of_several(tmp_path: Path) -> None:
    """In Python as the command line does, and in the file of the run."""
    case = with_friction(back=0.1)
    run = st.simulate(case, 0.4)
    assert [note.startswith("μ stands for one friction coefficient of all contacts") for note in run.notes] == [True]
    assert run.notes[0][:100] in run._repr_html_()
    assert st.open(st.save(run, tmp_path / "run.nc")).notes == run.notes
    assert st.simulate(case).notes == st.simulate(with_friction(), 0.4).notes == ()


@pytest.mark.slow
def test_onsets_along_the_friction_of_one_contact_leave_the_others_theirs() -> None:
    case = with_friction(back=0.1)
    found = st.onsets(case, (0.0, 0.4), along="contacts.rub.friction.coefficient")
    system = st.build_system(case)
    assert len(found)

    def growing_at(mu: float) -> int:
        touching = sliding(system, {"rub": mu, "back": 0.1, "guide": 0.0})[0] > 0.0
        return growing(system, touching, rub=mu, back=0.1, guide=0.0)

    changes = 0
    for value in sorted({onset.value for onset in found}):
        below, above = (growing_at(value * f) for f in (1 - 1e-4, 1 + 1e-4))
        here = [onset for onset in found if onset.value == value]
        assert above - below == sum(-1 if onset.stabilising else 1 for onset in here) != 0, here
        changes += above - below
    assert changes == growing_at(0.4) - growing_at(0.0)


def test_cycles_begin_at_onsets_beside_a_guide_without_friction() -> None:
    system, onset = st.build_system(with_friction()), onsets_of_the_case().onsets[0]
    family = HarmonicFamily(system, 60e3)
    omega = 2 * np.pi * onset.frequency_hz
    scale = scales(family, omega, onset.mu, 3)
    _, applied = still(family, onset.mu, scale)
    sizes = np.linalg.svd(small_motion(family, applied, scale, 1j * omega)[0])[1]
    assert sizes[-1] < 1e-3 * sizes[-2]


def two_points(one: float, other: float) -> System:
    """Two points on moving belts, in rows that couple them."""
    rows = {"a": ([0, 1, 0, 0], [1, 0, 0, 0]), "b": ([0, 0, 0, 1], [0, 0, 1, 0])}
    stiffness = np.array([[9.0, 2, -1, 0], [2, 8, 1, 0], [-1, 1, 7, 2], [0, 0, 2, 9]])
    return System.from_matrices(
        np.eye(4), 0.01 * np.eye(4), stiffness, loads={"press": [0.0, -1.0, 0.0, -1.0]},
        contacts={
            name: {"normal": normal, "tangent": tangent, "stiffness": 20.0,
                   "friction": {"law": "coulomb", "coefficient": mu}}
            for (name, (normal, tangent)), mu in zip(rows.items(), (one, other), strict=True)
        },
    )  # fmt: skip


@pytest.mark.parametrize(("given", "asked"), [((0.4, 0.0), (0.6, 0.0)), ((0.0, 0.4), (0.0, 0.6)),
                                              ((0.0, 0.0), (0.6, 0.6)), ((0.4, 0.1), (0.6, 0.6))])  # fmt: skip
def test_points_without_friction_have_none_beside_others_that_have_some(
    given: tuple[float, float], asked: tuple[float, float]
) -> None:
    system = two_points(*given)
    forces, values = truth(system, dict(zip("ab", asked, strict=True)))
    assert st.steady_sliding(system, 0.6).normal_force == pytest.approx(forces)
    for source in ("receptance", "krylov", "full"):
        found = st.modes(st.Workspace(system, modal={"max_frequency_hz": 10.0, "source": source}), 0.6).eigenvalues[0]
        own, other = (sorted(v[v.imag > 0], key=lambda z: (round(z.imag, 6), z.real)) for v in (found, values))
        assert own == pytest.approx(other, rel=1e-9)


def test_points_have_their_own_friction_where_none_is_asked_for() -> None:
    system = two_points(0.4, 0.1)
    values = truth(system, {"a": 0.4, "b": 0.1})[1]
    for source in ("receptance", "krylov", "full"):
        found = st.modes(st.Workspace(system, modal={"max_frequency_hz": 10.0, "source": source})).eigenvalues[0]
        own, other = (sorted(v[v.imag > 0], key=lambda z: (round(z.imag, 6), z.real)) for v in (found, values))
        assert own == pytest.approx(other, rel=1e-9)


def test_cycles_are_not_shot_at_where_nothing_slides_a_contact_without_friction() -> None:
    system = two_points(0.4, 0.0)
    assert not why_not_shooting(system)
    a, b = system.contacts
    guide = replace(system, contacts=(a, replace(b, tangent_lift=0.0 * b.tangent_lift)))
    assert why_not_shooting(guide).startswith("contact b has no friction and nothing slides it")
    assert st.steady_sliding(guide, 0.6).normal_force == pytest.approx(st.steady_sliding(system, 0.6).normal_force)


def test_what_friction_would_do_in_a_contact_without_any() -> None:
    case = with_friction()
    system = st.build_system(case)
    found = st.sensitivities(case, [BACK, "mu"], mu=0.3)
    assert found.values.tolist() == [0.0, 0.3]
    touching = sliding(system, {"rub": 0.3, "back": 0.0, "guide": 0.0})[0] > 0.0
    step = 1e-5

    def moved(**mu: float) -> np.ndarray:
        values = truth(system, mu, touching)[1]
        return np.array([values[np.argmin(np.abs(values - own))] for own in found.eigenvalues])

    back = (moved(rub=0.3, back=step, guide=0.0) - moved(rub=0.3, back=-step, guide=0.0)) / (2 * step)
    common = (moved(rub=0.3 + step, back=0.0, guide=0.0) - moved(rub=0.3 - step, back=0.0, guide=0.0)) / (2 * step)
    assert found.derivative[0] == pytest.approx(back, rel=1e-4)
    assert found.derivative[1] == pytest.approx(common, rel=1e-4)
    assert np.abs(back).min() > 1.0


def test_what_is_wrong_with_a_range_along_a_number_or_with_a_stepper_is_said_of_what_it_is() -> None:
    case = with_friction()
    with pytest.raises(CaseError, match=r"^range of supports\.drive\.velocity\.x: \[?\(?-0\.1, -5"):
        st.onsets(case, (-0.1, -5), along="supports.drive.velocity.x")
    with pytest.raises(CaseError, match=r"^friction_range: "):
        st.onsets(case, (0.5, 0.1))
    hard = case.with_({"contacts.rub.cubic": 1e20})
    for stepper in ("exact", "implicit"):
        with pytest.raises(CaseError, match="contact rub has a cubic part of its stiffness"):
            st.simulate(hard.with_({"temporal.stepper": stepper}))
