"""Reduced models with rigid contact, falling friction, friction damping and prestress against the full solve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

import stridor as st
from benches import Slave, bench_case, paper_case
from solid_cases import slider
from stridor.case import Case, loads
from stridor.modal.full import onsets_along
from stridor.modal.krylov import Options
from stridor.modal.krylov.problem import problem_of
from stridor.modal.parametric.contacts_equilibria import FEW, Equilibria
from stridor.modal.parametric.contacts_steady import contacts_of
from stridor.modal.parametric.full import verified
from stridor.study.reduced import parametric_problem, reduced_model
from stridor.system import build_system

pytestmark = pytest.mark.verification

DAMPED = {
    "bodies.block.damping": {"mass": 50.0, "stiffness": 1e-7},
    "bodies.slider.damping": {"mass": 20.0, "stiffness": 2e-8},
}
FALLING = {
    "contacts.rub.friction": {"law": "weakening", "coefficient": 0.1, "static_coefficient": 0.3, "decay_speed": 1.0}
}
COARSE = {"bodies.block.mesh.divisions": [6, 3], "bodies.slider.mesh.divisions": [9, 2]}
COARSE_3D = {"bodies.block.mesh.divisions": [4, 1, 2], "bodies.slider.mesh.divisions": [7, 2, 1]}
SEVERE = {"loads.press.force": [0.0, -2e5], "modal.prestress": True}
BEAMS = dict(
    angle_deg=0.0, velocity=0.02, length=0.15, thickness=3e-3, elements=12, damping=(50.0, 1e-8), mass="consistent",
    modulus_factor=1.0,
)  # fmt: skip


def block(stiffness: float | str, *changes: dict, space: bool = False) -> Case:
    case = loads(slider(space=space, stiffness=stiffness, mu=0.1)).with_({**DAMPED, **(COARSE_3D if space else COARSE)})
    for change in changes:
        case = case.with_(change)
    return case


def at(case: Case, point: dict[str, float]) -> Case:
    """The case with the numbers of a point but for μ."""
    changes: dict[str, float] = {k: v for k, v in point.items() if k not in ("mu", "contact_stiffness")}
    for name, contact in case.contacts.items():
        if contact.stiffness != "rigid":
            changes[f"contacts.{name}.stiffness"] = contact.stiffness * point.get("contact_stiffness", 1.0)
    return case.with_(changes)


def random_points(problem, count: int, seed: int = 1) -> list[dict[str, float]]:
    rng = np.random.default_rng(seed)
    return [{p.name: rng.uniform(p.low, p.high) for p in problem.parameters} for _ in range(count)]


def assert_is_the_full_solve(case: Case, box: dict, limit: float, *, count: int = 3, bound: float = 1e-8):
    """Every eigenvalue at random points of the box, the same nodes touching; and the onsets along μ."""
    model = reduced_model(case, box, max_frequency_hz=limit)
    assert not model.problem.notes
    points = random_points(model.problem, count)
    # Of several μ the nodes that touch are those of the case.
    if set(box) == {"mu"}:
        solved = list(st.modes(case, [p["mu"] for p in points], max_frequency_hz=limit).eigenvalues)
    else:
        solved = [st.modes(at(case, p), [0.0, p["mu"]], max_frequency_hz=limit).eigenvalues[1] for p in points]
    for point, full in zip(points, solved, strict=True):
        full = full[np.abs(full) < 0.98 * model.frequency]
        found = model.modes(point).values
        assert len(full) >= 3
        assert (np.abs(full[:, None] - found).min(axis=1) / np.abs(full)).max() < bound
    return model


def assert_same_onsets(case: Case, model, limit: float, *, rel: float = 1e-9) -> None:
    found = onsets_along(model, "mu")
    (friction,) = (p for p in model.problem.parameters if p.name == "mu")
    solved = st.onsets(case, (friction.low, friction.high), max_frequency_hz=limit).onsets
    assert [o.value for o in found] == pytest.approx([o.mu for o in solved], rel=rel)
    assert [o.frequency_hz for o in found] == pytest.approx([o.frequency_hz for o in solved], rel=rel)
    assert [o.growth_slope for o in found] == pytest.approx([o.growth_slope for o in solved], rel=1e-5)
    assert found


def test_rigid_contact_of_the_published_bench():
    case = paper_case(contacts__A__stiffness="rigid", bodies__beam1__elements=6, bodies__beam2__elements=18)
    model = assert_is_the_full_solve(case, {"mu": (0.0, 0.3)}, 30e3)
    assert model.problem.size == build_system(case).size - 1
    assert len(model.problem.terms) == 6
    assert_same_onsets(case, model, 30e3)


def test_rigid_and_elastic_contact_side_by_side():
    slaves = Slave(stiffness="rigid"), Slave(place=0.4, stiffness=1e8, lean_deg=-8.0)
    case = bench_case(*slaves, **BEAMS)
    assert st.steady_sliding(case).active.all()
    model = assert_is_the_full_solve(case, {"mu": (0.0, 0.4), "contact_stiffness": (0.5, 2.0)}, 20e3)
    assert model.problem.size == build_system(case).size - 1
    assert_same_onsets(case, model, 20e3)


def test_rigid_contact_on_a_slope():
    """Normals along no axis: no freedom is normal or tangential by itself."""
    slaves = [
        Slave(place=0.5, stiffness="rigid", lean_deg=lean, end="clamped", force=force, side=side)
        for lean, force, side in ((9.0, 10.0, 1), (-7.0, 40.0, -1))
    ]
    case = bench_case(*slaves, **{**BEAMS, "angle_deg": 33.0})
    assert st.steady_sliding(case).active.all()
    assert_is_the_full_solve(case, {"mu": (0.0, 0.5)}, 20e3)


@pytest.mark.slow
def test_a_body_between_two_others():
    """Its lower side is the slave of one contact, its upper side the master of another, finer one."""
    case = block("rigid", {
        "bodies.cover": {
            "type": "solid", "material": "steel", "model": "plane stress", "thickness": 0.03,
            "mesh": {
                "shape": "rectangle", "corner": [-0.04, 0.04], "size": [0.08, 0.02], "divisions": [8, 2],
                "cells": "quad",
            },
            "damping": {"mass": 30.0, "stiffness": 1e-8}, "sliding": {"velocity": [-1.0, 0.0]},
        },
        "supports.guide": {"at": "cover.left", "fixed": ["x"]},
        "loads.press": {"at": "cover.top", "force": [0.0, -1000.0]},
        "contacts.top": {
            "slave": "cover.bottom", "master": "block.top", "stiffness": "rigid",
            "friction": {"law": "coulomb", "coefficient": 0.1},
        },
        "springs.near.between": ["block.near", "ground"],
        "bodies.block.points.near": [-0.05, 0.02],
    })  # fmt: skip
    touching = st.steady_sliding(case).active
    assert np.count_nonzero(touching[:7]) > 2
    assert np.count_nonzero(touching[7:]) > 2
    model = assert_is_the_full_solve(case, {"mu": (0.0, 0.3)}, 25e3)
    assert model.problem.size == build_system(case).size - np.count_nonzero(touching)
    assert_same_onsets(case, model, 25e3)


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [1e12, "rigid"])
def test_falling_friction_over_a_surface(stiffness):
    case = block(stiffness, FALLING)
    box = {"mu": (0.0, 0.4)} | ({} if stiffness == "rigid" else {"contact_stiffness": (0.5, 2.0)})
    model = assert_is_the_full_solve(case, box, 25e3)
    assert_same_onsets(case, model, 25e3)
    if stiffness == "rigid":
        assert model.problem.size == build_system(case).size - 7


@pytest.mark.parametrize("space", [False, True])
def test_equilibria_from_one_factorisation(space):
    """Rigid and elastic contact together, as solved one by one, at any friction and stiffness."""
    system = build_system(block(1e12, space=space))
    nodes = system.contact_nodes()
    nodes = replace(nodes, compliance=np.where(np.arange(nodes.count) % 3 == 1, 0.0, nodes.compliance))
    touching = np.flatnonzero(np.arange(nodes.count) % 5 != 3)
    sense = contacts_of(system, touching).sense
    many = Equilibria(system, nodes, touching, sense, None)
    rng = np.random.default_rng(4)
    for k in range(FEW + 4):
        mu, stiffness = np.full(nodes.count, rng.uniform(0.0, 0.6)), float(rng.uniform(0.2, 5.0))
        alone = Equilibria(system, nodes, touching, sense, None).at(mu, stiffness)
        found = many.at(mu, stiffness)
        assert (many._many is None) == (k < FEW)
        for name in ("displacement", "normal_force", "gap"):
            one, two = getattr(found, name), getattr(alone, name)
            assert np.abs(one - two).max() < 1e-11 * np.abs(two).max()
        assert np.abs(alone.normal_force).max() > 1.0
    many.free()


@pytest.mark.slow
def test_prestress_friction_stiffness_and_a_modulus_at_once():
    case = block(1e12, FALLING, SEVERE)
    box = {"mu": (0.1, 0.4), "contact_stiffness": (0.8, 1.25), "materials.steel.young_modulus": (190e9, 210e9)}
    problem = parametric_problem(case, box)
    options = Options(prestress=True)
    for point in random_points(problem, 3):
        mu = point["mu"]
        held = problem_of(build_system(at(case, point)), mu, options)
        assert len(held.touching) == 7
        extra, mine = held.at(mu), problem.at(point)
        weakening = held.slip.T @ sp.diags_array(extra.weakening) @ held.slip
        push = held.normal + mu * held.slide
        springs = push.T @ sp.diags_array(1 / held.compliance) @ held.normal
        for found, whole, added in (
            (mine.mass, held.mass, held.mass),
            (mine.damping, held.damping + weakening, weakening),
            (mine.stiffness, held.stiffness + springs + extra.stiffness, extra.stiffness),
        ):
            assert abs(found - whole).max() < 1e-10 * abs(added).max() + 1e-14 * abs(whole).max()
    assert abs(extra.stiffness).max() > 1e-6 * abs(held.stiffness).max()


@pytest.mark.slow
def test_friction_damping_in_space():
    case = block(1e12, FALLING, {"modal.friction_damping": True}, space=True)
    case = case.with_({"modal.prestress": True, "loads.press.force": [0.0, 0.0, -2e4]})
    model = assert_is_the_full_solve(case, {"mu": (0.0, 0.2)}, 15e3, count=2)
    assert_same_onsets(case, model, 15e3)
    rigid = case.with_({"contacts.rub.stiffness": "rigid"})
    assert_is_the_full_solve(rigid, {"mu": (0.0, 0.2)}, 15e3, count=2)


@pytest.mark.parametrize("given", [1e12, pytest.param("rigid", marks=pytest.mark.slow)])
def test_own_friction_where_it_is_not_varied(given):
    for stiffness in (given,):
        case = block(stiffness, FALLING)
        model = reduced_model(case, {"bodies.block.damping.stiffness": (0.0, 2e-7)}, max_frequency_hz=25e3)
        point = {"bodies.block.damping.stiffness": 1.3e-7}
        full = st.modes(case.with_(point), max_frequency_hz=25e3).eigenvalues[0]
        found = model.modes(point).values
        assert (np.abs(full[:, None] - found).min(axis=1) / np.abs(full)).max() < 1e-8


@pytest.mark.slow
def test_a_law_that_changes_its_shape():
    """How fast friction falls with speed is a number of the case that no matrix has but by steady sliding."""
    case = block("rigid", FALLING)
    box = {"mu": (0.1, 0.3), "contacts.rub.friction.decay_speed": (0.5, 2.0)}
    model = assert_is_the_full_solve(case, box, 25e3, count=2)
    dampings = [t for t in model.problem.terms if t.role == "damping"]
    assert len(dampings) > 2


def test_vectors_are_those_of_the_system():
    """Expanded, they close the gaps, and forces of the contacts alone leave the equations of motion unbalanced."""
    case = block("rigid")
    model = reduced_model(case, {"mu": (0.0, 0.4)}, max_frequency_hz=25e3)
    system = build_system(case)
    held = problem_of(system, None, Options())
    found = verified(model, {"mu": 0.3}, which="all")
    lam = found.values
    u = model.problem.displacements(found.right)
    y = model.problem.left_displacements(found.left, {"mu": 0.3})
    push = sp.csr_array(held.normal + 0.3 * held.slide)
    for vectors, forces, rows, side in ((u, push, held.normal, "right"), (y, held.normal, push, "left")):
        assert vectors.shape == (system.size, len(lam))
        assert np.abs(rows @ vectors).max() < 1e-12 * np.abs(vectors).max()
        unbalanced = lam**2 * (system.mass @ vectors) + lam * (system.damping @ vectors) + system.stiffness @ vectors
        judge = held.pencil(0.3) if side == "right" else held.pencil(0.3).transposed
        p = np.linalg.lstsq(forces.T.toarray(), unbalanced, rcond=None)[0]
        error = judge.backward_error(lam, vectors, p)
        assert error.max() < 1e-11


def test_what_is_held_is_said():
    """Nodes that would lift off at higher friction count as touching, and a sentence says so."""
    case = block(1e12, FALLING, {"contacts.rub.friction.static_coefficient": 0.2})
    assert not parametric_problem(case, {"mu": (0.0, 0.3)}).notes
    (note,) = parametric_problem(case, {"mu": (0.0, 1.2)}).notes
    assert note.startswith("At mu = 1.2 ")
    assert note.endswith("of 7 touching nodes would lift off; the reduced model holds the nodes that touch in the case as it is.")


def test_what_is_held_is_said_without_steady_terms_too():
    """Springs and Coulomb's law ask for no steady state at any μ, and yet other nodes touch at another."""
    case = block(1e12)
    assert not parametric_problem(case, {"mu": (0.0, 0.1)}).notes
    (note,) = parametric_problem(case, {"mu": (0.0, 1.2)}).notes
    assert "contact nodes that touch at the case's own friction are held at every μ of the model" in note
    assert "to 1.2 (" in note


def test_what_reduced_models_of_contacts_refuse():
    rigid, falling = block("rigid"), block(1e12, FALLING)
    for case, box, message in (
        (rigid, {"contact_stiffness": (0.5, 2.0)}, r"box\.contact_stiffness: missing|rigid contact has no stiffness to vary"),
        (rigid, {"contacts.rub.friction.coefficient": (0.1, 0.2)}, "varied for all contacts together, by mu"),
        (rigid, {"bodies.block.mesh.corner.0": (-0.05, -0.04)}, "moves where rigid contact touches"),
        (
            rigid,
            {"mu": (0.1, 0.2), "contacts.rub.friction.coefficient": (0.1, 0.2)},
            r"friction\.coefficient: missing – give a range of mu|give a range of mu",
        ),
        (falling.with_({"loads": {}}), {"mu": (0.0, 0.1)}, "a friction law with a slope needs the normal force"),
    ):
        with pytest.raises((st.CaseError, st.AnalysisError), match=message):
            parametric_problem(case, box)
