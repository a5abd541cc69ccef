"""Patterns of pressure: what a contact without any force brings about."""

from __future__ import annotations

import warnings
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from stridor.contact.coupling import SlaveFacets
from stridor.contact.curve import Curve
from stridor.contact.facets import FacetSurface
from stridor.contact.obstacles import Cylinder, Flat
from stridor.mesh.facets import reference_nodes
from stridor.sliding import pattern
from stridor.sliding.pattern import OUTLINES, _alternates, _neighbours, _open_amid, left_by_facets, unexplained_patterns
from stridor.system import System

# What NumPy warns of is a fault here, whatever comes of it.
pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def system_of(contacts: tuple[Any, ...], surfaces: tuple[Any, ...], nodes: Any) -> Any:
    system: Any = SimpleNamespace(contacts=contacts, surfaces=surfaces, contact_nodes=lambda: nodes)
    system.nodes_of_surfaces = lambda: System.nodes_of_surfaces(system)
    return system


@pytest.mark.parametrize("force", [0.0, 1.0])
def test_a_contact_that_touches_without_force_has_no_pattern_and_no_warning(force):
    positions = np.column_stack([np.arange(4.0), np.zeros(4)])
    lines = np.column_stack([np.arange(3), np.arange(1, 4)])
    facets = SlaveFacets.of(positions, {"line": lines}, np.arange(4))
    nodes: Any = SimpleNamespace(count=4, area=np.ones(4), gap=np.zeros(4), closed=np.zeros(4, dtype=bool))
    surface = SimpleNamespace(
        name="rub", nodes=nodes, facets=facets, slave_position=positions, master=Flat(np.zeros(2), np.array([0.0, 1.0])),
        location=SimpleNamespace(normal=np.tile([0.0, 1.0], (4, 1)), gap=np.zeros(4)), own=np.arange(4),
    )  # fmt: skip
    system: Any = system_of((), (surface,), nodes)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        told = list(unexplained_patterns(system, np.full(4, force), np.zeros(4), np.ones(4, dtype=bool)))
    assert told == []


# -- which nodes follow each other -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", OUTLINES)
def test_neighbours_are_those_along_the_outline(kind: str) -> None:
    """In order of the angle about the middle the nodes on the edge follow each other; a centre is next to the middles
    of the edges."""
    places = reference_nodes(kind)
    if places.shape[1] == 1:
        order = np.argsort(places[:, 0])
        expected = {frozenset(pair) for pair in pairwise(order.tolist())}
    else:
        away = places - (1 / 3 if kind.startswith("triangle") else 0.5)
        rim = np.flatnonzero(np.abs(away).max(axis=1) > 1e-9)
        order = rim[np.argsort(np.arctan2(away[rim, 1], away[rim, 0]))]
        expected = {frozenset(pair) for pair in zip(order.tolist(), np.roll(order, 1).tolist(), strict=True)}
        for centre in np.flatnonzero(np.abs(away).max(axis=1) <= 1e-9).tolist():
            expected |= {frozenset((centre, k)) for k in rim.tolist() if np.sum(away[k] != 0) == 1}
    count = len(places)
    for left_out in range(-1, count):
        # Those that take part are numbered backwards.
        taking = np.delete(np.arange(count), left_out)[::-1] if left_out >= 0 else np.arange(count)[::-1]
        own = np.full(count, -1)
        own[taking] = np.arange(len(taking))
        found = _neighbours(SlaveFacets({kind: np.arange(count)[None]}, own, {}), len(taking)).toarray()
        wanted = np.zeros((len(taking), len(taking)))
        for a, b in map(tuple, expected):
            if min(own[a], own[b]) >= 0:
                wanted[own[a], own[b]] = wanted[own[b], own[a]] = 1
        assert np.array_equal(found, wanted), left_out


def test_nodes_that_are_one_have_the_neighbours_of_both() -> None:
    """A line whose ends are one node is a ring; between two that are one there is nothing."""
    lines = np.column_stack([np.arange(4), np.arange(1, 5)])
    facets = SlaveFacets({"line": lines}, np.arange(5), {})
    found = _neighbours(facets, 4, np.array([0, 1, 2, 3, 0])).toarray()
    assert np.array_equal(found, [[0, 1, 0, 1], [1, 0, 1, 0], [0, 1, 0, 1], [1, 0, 1, 0]])
    assert np.array_equal(_neighbours(facets, 3, np.array([0, 1, 2, 1, 1])).toarray(), [[0, 1, 0], [1, 0, 1], [0, 1, 0]])


# -- a grid of nodes on a flat master ----------------------------------------------------------------------------------


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(float(n)), np.arange(float(n)), indexing="ij")
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)]), np.column_stack(
        [first, first + 1, first + n + 1, first + n]
    )


def words_of(force, gap, *, before=None, area=1.0, others: int = 3, closed=False, active=None) -> list[str]:
    """What is said of a surface of n × n nodes, after ``others`` nodes of another contact without facets."""
    n = int(np.sqrt(len(force)))
    positions, quads = grid(n)
    facets = SlaveFacets.of(positions, {"quad": quads}, np.arange(n * n))
    before = np.zeros(n * n) if before is None else before
    location = SimpleNamespace(normal=np.tile([0.0, 0.0, 1.0], (n * n, 1)), gap=before)
    master = Flat(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    nodes = SimpleNamespace(count=n * n, closed=(closed,))
    surface = SimpleNamespace(
        name="pad", nodes=nodes, facets=facets, slave_position=positions, master=master, location=location, own=np.arange(n * n),
    )  # fmt: skip
    plain = SimpleNamespace(nodes=SimpleNamespace(count=others, closed=()), facets=None, name="plain")
    count = others + 2 + n * n
    lead = np.full(others + 2, 7.0)
    everything: Any = SimpleNamespace(
        gap=np.concatenate([lead, before]), area=np.concatenate([lead, np.full(n * n, area)]), count=count,
    )  # fmt: skip
    system: Any = system_of((0, 0), (plain, surface), everything)
    active = np.asarray(force) > 0 if active is None else active
    return list(
        unexplained_patterns(
            system, np.concatenate([lead, force]), np.concatenate([lead, gap]),
            np.concatenate([np.ones(len(lead), dtype=bool), active]),
        )
    )  # fmt: skip


def with_hole(*holes: int, n: int = 5, beside: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Force 1 N and gap 0, but at the holes, which are open by 1 µm; `beside` N at the neighbours of the first."""
    force, gap = np.ones(n * n), np.zeros(n * n)
    force[[holes[0] - 1, holes[0] + 1, holes[0] - n, holes[0] + n]] = beside
    force[list(holes)], gap[list(holes)] = 0.0, 1e-6
    return force, gap


def test_holes_amid_pressure_are_counted_and_told() -> None:
    said = words_of(*with_hole(6, 8, 18))
    assert len(said) == 1
    assert said[0].startswith(
        "contact pad: 3 of 25 slave nodes stand open amid touching ones, which neither gap nor pressure explains; refine"
    )
    # Side by side, or in a contact kept closed, they are no holes; at a corner with touching ones on both sides one is.
    assert words_of(*with_hole(6, 7)) == []
    assert words_of(*with_hole(12), closed=True) == []
    corner = np.ones(25), np.zeros(25)
    corner[0][0], corner[1][0] = 0.0, 1e-6
    assert len(words_of(*corner)) == 1
    # Touching without any force is open here; whatever force is given to what does not touch is none.
    force, gap = with_hole(12)
    assert len(words_of(force, gap, active=np.ones(25, dtype=bool))) == 1
    force[12] = 1.0
    assert len(words_of(force, gap, active=gap == 0)) == 1


def test_a_hole_that_gap_or_pressure_explains_is_none() -> None:
    # The neighbours have a fifth of the mean pressure of those that touch, or a little less.
    rest = 20.0
    limit = 0.2 * rest / (24 - 4 * 0.2)  # b = 0.2 (4 b + 20)/24
    assert len(words_of(*with_hole(12, beside=1.001 * limit))) == 1
    assert words_of(*with_hole(12, beside=0.999 * limit)) == []
    # Half of what it stands open by was there from the beginning.
    for share, told in ((0.499, 1), (0.501, 0)):
        before = np.zeros(25)
        before[12] = share * 1e-6
        assert len(words_of(*with_hole(12), before=before)) == told
    before = np.full(25, 3e-6)  # of all alike: explains nothing
    force, gap = with_hole(12)
    assert len(words_of(force, gap + 3e-6, before=before)) == 1


def test_pressure_that_alternates_is_told_beyond_four_tenths_of_its_mean() -> None:
    sign = np.where((np.arange(5)[:, None] + np.arange(5)) % 2, -1.0, 1.0).ravel()
    for size, told in ((0.198, 0), (0.202, 1)):  # neighbours have the other sign: they differ by twice that
        said = words_of(3.0 * (1 + size * sign) / (1 + size / 25), np.zeros(25), area=0.5)
        assert len(said) == told
    assert said[0].startswith("contact pad: the pressure jumps from node to node by more than 40% of its mean; refine")
    # As pressure, not as force; and of eight nodes that have all their neighbours, not of fewer.
    assert words_of(np.where(sign > 0, 2.0, 1.0), np.zeros(25), area=np.where(sign > 0, 2.0, 1.0)) == []
    few = np.where(sign.reshape(5, 5)[:3, :3] > 0, 2.0, 1.0).ravel()
    assert len(words_of(few, np.zeros(9))) == 1
    few[[0]] = 0.0
    assert words_of(few, np.zeros(9)) == []  # two nodes less: the open one's neighbours do not count


# -- curved surfaces ---------------------------------------------------------------------------------------------------


def chain(n: int) -> sp.csr_array:
    return sp.csr_array(sp.diags_array([np.ones(n - 1), np.ones(n - 1)], offsets=[-1, 1]))


def test_a_pattern_takes_eight_nodes_and_a_hole_two_neighbours() -> None:
    for n, told in ((7, False), (8, True)):
        assert _alternates(chain(n), np.ones(n, dtype=bool), np.arange(n) % 2 + 0.5) is told
    for at, count in ((0, 0), (1, 1), (4, 0)):
        gap = np.where(np.arange(5) == at, 1e-6, 0.0)
        assert _open_amid(chain(5), gap == 0, 1.0 * (gap == 0), np.zeros(5), gap) == count
    # One that no facet knows has no neighbours, and is neither.
    lonely = sp.block_diag([chain(7), sp.csr_array((1, 1))], format="csr")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not _alternates(lonely, np.ones(8, dtype=bool), np.arange(8) % 2 + 0.5)
        assert _open_amid(lonely, np.arange(8) < 7, 1.0 * (np.arange(8) < 7), np.zeros(8), 1e-6 * (np.arange(8) == 7)) == 0


# -- curved surfaces ---------------------------------------------------------------------------------------------------


def two_contacts(gap, *, master, normal=None, first: int = 2) -> Any:
    """One after another contact of ``first`` nodes on a flat, and a point contact; gap (m,) of the second."""
    m = len(gap)
    angle = 2 * np.pi * np.arange(m) / m
    round_about = np.column_stack([np.cos(angle), np.sin(angle)])
    lead = SimpleNamespace(
        name="lead", nodes=SimpleNamespace(count=first, closed=()), slave_position=np.zeros((first, 2)), facets=None,
        master=Flat(np.zeros(2), np.array([0.0, 1.0])),
        location=SimpleNamespace(normal=np.tile([0.0, 1.0], (first, 1)), gap=np.zeros(first)),
    )  # fmt: skip
    cells = np.column_stack([np.arange(m), np.roll(np.arange(m), -1)])
    shaft = SimpleNamespace(
        name="shaft", nodes=SimpleNamespace(count=m, closed=()), slave_position=0.2 * round_about, master=master,
        location=SimpleNamespace(normal=-round_about if normal is None else normal, gap=np.asarray(gap)),
        facets=SlaveFacets.of(round_about, {"line": cells}, np.arange(m)), own=np.arange(m),
    )  # fmt: skip
    gaps = np.concatenate([np.full(1 + first, 9e-6), gap])
    nodes = SimpleNamespace(gap=gaps, area=np.ones(len(gaps)), count=len(gaps))
    return system_of((0,), (lead, shaft), nodes)


def test_facets_of_a_shaft_are_below_it_by_its_sagitta_and_those_of_a_flat_by_nothing() -> None:
    bore = Cylinder(np.zeros(2), 0.2, inside=True)
    for count in (40, 80):
        shaft = two_contacts(np.zeros(count), master=bore).surfaces[1]
        sagitta = 0.2 * (1 - np.cos(np.pi / count))
        assert pattern.facet_height(shaft) == pytest.approx(1.5 * sagitta, rel=0.01)
    straight = two_contacts(np.zeros(40), master=bore, normal=np.tile([0.0, 1.0], (40, 1))).surfaces[1]
    assert pattern.facet_height(straight) == 0.0


def test_flats_between_edges_leave_nothing_of_a_curve_though_nodes_off_them_look_away() -> None:
    profile = np.array([[-4.0, -2.0], [-2.0, -1.0], [0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [22.0, -1.0], [24.0, -2.0]])
    line = np.column_stack([np.arange(6), np.arange(1, 7)])
    plane = Curve.from_facets(profile, {"line": line[:, ::-1]}, where="w")
    y = np.array([0.0, 5.0, 10.0])
    points = np.array([[x, v, z] for v in y for x, z in profile])
    quads = np.array([[7 * j + i, 7 * j + i + 1, 7 * j + i + 8, 7 * j + i + 7] for j in range(2) for i in range(6)])
    space = FacetSurface.from_facets(points, {"quad": quads}, where="w")
    x = np.linspace(-3.0, 23.0, 27)
    flat = np.column_stack([x, np.full(27, 4.0)])
    over = np.array([[u, v, w] for v in np.linspace(1, 9, 9) for u, w in flat])
    for master, slaves in ((plane, flat), (space, over)):
        found = master.locate(slaves)
        # Off the edges nodes do look away from them, between the sides that turn by 27°.
        tilt = np.degrees(np.arccos(np.clip(found.normal[:, -1], -1, 1)))
        assert np.any((tilt > 1.0) & (tilt < 26.0))
        surface = SimpleNamespace(slave_position=slaves, location=found, master=master)
        assert pattern.facet_height(surface) == 0.0


def test_what_facets_leave_open_all_over_is_told_with_its_remedy(monkeypatch) -> None:
    monkeypatch.setattr(pattern, "facet_height", lambda surface: 1e-5 if surface.name == "shaft" else 0.0)
    gap = np.linspace(2e-6, 2e-5, 8)
    system = two_contacts(gap, master=None)
    assert list(left_by_facets(system)) == [
        "the facets of the curved surfaces of contact shaft leave gaps up to 2e-05 m, so that nothing touches; let the "
        f"nodes of both sides match, refine, or close such gaps and overlaps with contacts.shaft.adjust = {1.1 * gap[3]:.2g}"
    ]
    for worst in (2.001e-5, 0.0):
        assert list(left_by_facets(two_contacts(np.append(gap[:-1], worst), master=None))) == []
    system = two_contacts(np.array([1.5e-5, 1.9e-5]), master=None)
    assert next(left_by_facets(system)).endswith("adjust = 1e-08")


def test_nodes_that_stand_open_by_no_more_than_facets_leave_are_counted(monkeypatch) -> None:
    h = 2.0**-17
    monkeypatch.setattr(pattern, "facet_height", lambda surface: h if surface.name == "shaft" else 0.0)
    # Gaps before, least h/8: touches; open by too little to begin with; by enough; as far as may be; now too far;
    # before too far; and two that touch.
    before = h / 8 + h * np.array([0, 0.9e-3, 1.1e-3, 2, 1 / 8, 2.01, 0, 1 / 8])
    after = h * np.array([0, 0.1, 0.1, 2, 2.01, 0.1, 0, 0])
    touches = np.array([True, False, False, False, False, False, True, True])
    system = two_contacts(before, master=None)
    force = np.concatenate([np.ones(3), 1.0 * touches])
    told = list(
        unexplained_patterns(
            system, force, np.concatenate([np.zeros(3), after]), np.concatenate([np.ones(3, dtype=bool), touches])
        )
    )
    assert told == [
        "contact shaft: 2 of 8 slave nodes stand open by no more than facets leave of curved surfaces (7.6e-06 m), so that "
        "the meshes decide what touches; let the nodes of both sides match, refine, or close such gaps and overlaps with "
        "contacts.shaft.adjust = 2.1e-06"
    ]
