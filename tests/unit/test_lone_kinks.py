"""Edges of plane masters by how a line turns at a node against the nodes around: a chamfer is one, an arc has none."""

from __future__ import annotations

import numpy as np
import pytest

import stridor as st
from stridor.contact.curve import Curve
from stridor.contact.facets import FacetSurface


def line(points, *, closed: bool = False, quadratic: bool = False) -> Curve:
    """The curve through points (k, 2); of quadratic facets every second is a middle."""
    count = len(points)
    start = np.arange(count if closed else count - 1)
    blocks = {"line": np.stack([start, (start + 1) % count], axis=1)}
    if quadratic:
        start = start[::2]
        blocks = {"line3": np.stack([start, (start + 2) % count, start + 1], axis=1)}
    return Curve.from_facets(np.asarray(points, dtype=float), blocks, where="contacts.face.master")


def arc(angles, radius: float = 1.0):
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def divided(points, parts: int):
    """Each segment of a closed line in parts, nodes on its chord."""
    share = np.arange(parts)[None, :, None] / parts
    return (points[:, None] * (1 - share) + np.roll(points, -1, axis=0)[:, None] * share).reshape(-1, 2)


def chamfered(facets: int, angle_deg: float):
    """The face of a pad of 40 mm whose chamfers take 4 mm at both ends."""
    x = np.linspace(0.0, 40.0, facets + 1)
    off = np.clip(4.0 - np.minimum(x, 40.0 - x), 0.0, None)
    return np.stack([x, off * np.tan(np.radians(angle_deg))], axis=1)


@pytest.mark.parametrize("angle_deg", [-20.0, 0.3, 2.0, 20.0, 39.0])
@pytest.mark.parametrize("facets", [10, 20, 80])
def test_chamfers_are_edges_at_any_angle_between_runs_of_facets(facets, angle_deg):
    curve = line(chamfered(facets, angle_deg))
    assert curve.positions[curve.corners, 0] == pytest.approx([4.0, 36.0])
    assert curve.chord_height == pytest.approx(0.0, abs=1e-14)
    if facets == 10 and angle_deg == 39.0:
        return  # between its corner of 51° and a chamfer of one facet, it might be a coarse fillet
    whole = np.concatenate([chamfered(facets, angle_deg), [[40.0, 12.0], [20.0, 12.0], [0.0, 12.0]]])
    curve = line(whole, closed=True)
    assert len(curve.corners) == 6
    if facets == 20:
        assert line(chamfered(facets, angle_deg), quadratic=True).corners.tolist() == [2, 18]


def test_no_arc_has_edges_whatever_the_lengths_of_its_facets():
    rng = np.random.default_rng(3)
    for _ in range(60):
        steps = rng.uniform(0.03, 1.0, rng.integers(24, 60)) ** rng.integers(1, 4)
        angles = np.cumsum(steps) / steps.sum() * rng.uniform(0.1, 1.0)
        assert not len(line(arc(angles)).corners)
        steps = rng.uniform(0.1, 1.0, 40)
        assert not len(line(arc(2 * np.pi * np.cumsum(steps) / steps.sum()), closed=True).corners)
    ellipse = arc(np.linspace(0, 2 * np.pi, 90, endpoint=False)) * [3.0, 1.0]
    assert not len(line(ellipse, closed=True).corners)


@pytest.mark.parametrize(("facets", "turn", "edges"), [(1, 30, 0), (2, 60, 0), (3, 90, 0), (8, 90, 0), (2, 90, 1)])
def test_a_fillet_between_straight_sides_has_no_edges_but_sharp_ones(facets, turn, edges):
    angles = np.radians(np.linspace(-90.0, -90.0 + turn, facets + 1))
    bent = arc(angles) + np.array([0.0, 1.0])
    along = np.array([-np.sin(angles[-1]), np.cos(angles[-1])])
    before = np.stack([np.arange(-5.0, 0.0), np.zeros(5)], axis=1)
    curve = line(np.concatenate([before, bent, bent[-1] + np.arange(1.0, 6.0)[:, None] * along]))
    assert len(curve.corners) == edges


@pytest.mark.parametrize("parts", [2, 5])
def test_a_curve_whose_facets_were_divided_on_their_chords_is_still_one(parts):
    ring = divided(arc(np.linspace(0, 2 * np.pi, 24, endpoint=False)), parts)
    assert not len(line(ring, closed=True).corners)
    assert not len(line(ring[: 9 * parts + 1]).corners)
    if parts == 2:
        assert not len(line(ring, closed=True, quadratic=True).corners)
        assert not len(line(ring[:19], quadratic=True).corners)


@pytest.mark.parametrize("turned", [0.0, 1.0, 2.5])
@pytest.mark.parametrize(
    ("angle_deg", "own_deg", "seen_deg"),
    # Out of the flat at 0°, out of the chamfer at −20°: what the slave looks against, and what is taken of it.
    [(20.0, 0.0, 0.0), (20.0, -7.0, -7.0), (20.0, 12.0, 0.0), (20.0, -35.0, -20.0), (60.0, -35.0, -35.0)],
)
def test_a_slave_at_a_corner_looks_its_own_way_between_those_of_the_sides(turned, angle_deg, own_deg, seen_deg):
    def at(deg: float):
        return np.array([np.sin(np.radians(deg) + turned), -np.cos(np.radians(deg) + turned)])

    turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    curve = line(chamfered(20, angle_deg) @ turn.T)
    slave = np.array([[4.0, 0.0]]) @ turn.T
    for moved in (0.0, 1e-9, -1e-9):
        there = slave + moved * turn[:, 0]
        found = curve.at_corners(curve.locate(there), there, -at(own_deg)[None])
        assert found.normal[0] == pytest.approx(at(seen_deg), abs=1e-12)
        assert abs(found.gap[0]) < 2e-9
    unknown = curve.at_corners(curve.locate(slave), slave, np.zeros((1, 2)))
    assert unknown.normal == pytest.approx(curve.locate(slave).normal)
    beside = slave + 0.01 * turn[:, 0]
    assert curve.at_corners(curve.locate(beside), beside, -at(-7.0)[None]).normal[0] == pytest.approx(at(0.0))


@pytest.mark.parametrize(
    ("own_deg", "seen_deg"), [(0.0, 0.0), (7.0, 7.0), (-12.0, 0.0), (40.0, 40.0), (60.0, 45.0)]
)
def test_a_slave_in_a_notch_looks_its_own_way_between_those_of_the_sides(own_deg, seen_deg):
    """Out of the sides at 0° and 45°."""

    def at(deg: float):
        return np.array([-np.sin(np.radians(deg)), -np.cos(np.radians(deg))])

    curve = line([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, -1.0], [4.0, -2.0]])
    for moved in (0.0, 1e-9, -1e-9):
        there = np.array([[2.0 + moved, 0.0]])
        found = curve.at_corners(curve.locate(there), there, -at(own_deg)[None])
        assert found.normal[0] == pytest.approx(at(seen_deg), abs=1e-12)
        assert abs(found.gap[0]) < 2e-9
    beside = np.array([[1.99, 0.0]])
    assert curve.at_corners(curve.locate(beside), beside, -at(7.0)[None]).normal[0] == pytest.approx(at(0.0))


def test_a_line_that_turns_once_and_a_single_node_between_two_facets():
    assert not len(line([[0, 0], [1, 0], [2, 0.3]]).corners)  # nothing tells an arc of two facets from a kink
    assert line([[0, 0], [1, 0], [2, 0], [3, 0.3], [4, 0.6]]).corners.tolist() == [2]
    assert not len(line([[0, 0], [1, 0], [2, 0], [3, 0.3]]).corners)  # nor a curve with an inflection beside its end
    assert line([[0, 0], [1, 0], [2, 0], [3, 0], [4, 0.3]]).corners.tolist() == [3]


def test_curves_with_inflections_and_coarse_fillets_have_no_edges():
    x = np.linspace(0.0, 2 * np.pi, 17)
    for waves in (1.0, 1.5, 2.0, 2.5):
        assert not len(line(np.stack([x, 0.3 * np.sin(waves * x)], axis=1)).corners)
    rng = np.random.default_rng(5)
    for _ in range(40):
        t = np.sort(rng.uniform(0.0, 3.0, 40))
        t = t[np.diff(t, prepend=-1.0) > 0.02]
        cubic = np.stack([t, rng.normal() * t + 0.2 * rng.normal() * t**2 + 0.1 * rng.normal() * t**3], axis=1)
        assert not len(line(cubic).corners)
    slanted = np.round(np.linspace(0.0, 1.0, 41)[:, None] * [np.cos(0.4), np.sin(0.4)], 5)
    assert not len(line(slanted).corners)


def test_a_flat_slave_touches_all_of_the_flat_of_a_chamfered_master(tmp_path, monkeypatch):
    """A spline through the kinks bulges out of the flat beside them by 0.05 mm: two nodes would touch."""
    monkeypatch.chdir(tmp_path)
    x = np.linspace(0.0, 0.04, 21)
    low = 1e-3 * chamfered(20, 20.0)[:, 1]
    lines = ["*NODE"]
    for row, share in enumerate((0.0, 0.5, 1.0)):
        lines += [f"{100 * row + i + 1}, {x[i]:.12g}, {low[i] * (1 - share) + 0.012 * share:.12g}" for i in range(21)]
    lines.append("*ELEMENT, TYPE=CPS4, ELSET=all")
    for row in range(2):
        for i in range(1, 21):
            a = 100 * row + i
            lines.append(f"{a + 1000}, {a}, {a + 1}, {a + 101}, {a + 100}")
    lines += ["*NSET, NSET=low, GENERATE", "1, 21", "*NSET, NSET=high, GENERATE", "201, 221"]
    (tmp_path / "pad.inp").write_text("\n".join(lines) + "\n", encoding="utf-8")
    body = {"type": "solid", "model": "plane stress", "thickness": 0.01, "material": "iron"}
    block = {"shape": "rectangle", "corner": [-0.02, -0.02], "size": [0.08, 0.02], "divisions": [40, 2], "cells": "quad"}
    case = st.Case(
        materials={"iron": {"young_modulus": 1e11, "density": 7200.0, "poisson_ratio": 0.27}},
        bodies={"disc": body | {"mesh": block, "sliding": {"velocity": [1.0, 0.0]}}, "pad": body | {"file": "pad.inp"}},
        supports={"ground": {"at": "disc.bottom", "fixed": ["x", "y"]}, "abutment": {"at": "pad.high", "fixed": ["x"]}},
        loads={"piston": {"at": "pad.high", "pressure": 1e5}},
        contacts={
            "face": {
                "slave": "disc.top", "master": "pad.low", "stiffness": 1e13,
                "friction": {"law": "coulomb", "coefficient": 0.3},
            }
        },
    )  # fmt: skip
    steady = st.steady_sliding(case, 0.3)
    assert not [w for w in steady.warnings if "curved" in w]
    assert int(steady.active.sum()) == 17  # of 2 mm on 32 mm, both edges touched
    assert steady.resultants["face"].force[1] == pytest.approx(-40.0)
    # Nodes on the corners look the way of the slave: the support above takes friction alone.
    assert abs(steady.resultants["face"].force[0]) == pytest.approx(0.3 * 40.0, rel=1e-12)


def test_nine_chords_all_round_are_corners_all_of_them() -> None:
    """They turn by 40°, the angle itself: rounding must not tell some from others."""
    angle = 0.3 + np.radians(np.arange(0.0, 361.0, 40.0))
    points = np.column_stack([np.cos(angle), np.sin(angle)])[::-1]
    lines = np.column_stack([np.arange(9), np.append(np.arange(1, 9), 0)])
    curve = Curve.from_facets(points[:9], {"line": lines}, where="nine")
    ends = np.concatenate([curve.stencils[:, 0], curve.stencils[:, 3]])
    assert np.count_nonzero(ends < 0) == 18


def test_nine_facets_all_round_have_edges_between_all_of_them() -> None:
    angle = 0.3 + np.radians(np.arange(0.0, 360.0, 40.0))
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([np.column_stack([ring, np.full(9, z)]) for z in (0.0, 1.0)])
    after = np.append(np.arange(1, 9), 0)
    quads = np.column_stack([np.arange(9), after, after + 9, np.arange(9) + 9])
    surface = FacetSurface.from_facets(points, {"quad": quads}, where="nine")
    assert np.count_nonzero(surface.sharp) == 18
