"""Pictures and files of solids in contact: from small systems made by hand, each shows what it should."""

from __future__ import annotations

import base64
import io
import itertools
import json
import re
import shutil
import subprocess
import time
from functools import cache
from pathlib import Path

import matplotlib as mpl
import meshio
import numpy as np
import pytest
import scipy.sparse as sp
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.figure import Figure
from PIL import Image

from stridor.contact.interface import Rows
from stridor.contact.master import Location
from stridor.contact.surfaces import SurfaceContact, operators
from stridor.errors import AnalysisError, CaseError
from stridor.io.vtk import write_vtk
from stridor.laws import Coulomb
from stridor.system.model import Line, Solid, System
from stridor.temporal.node_history import NodeHistory
from stridor.view import field_plots, solid_plots
from stridor.view.animation import animation_gif, animation_html
from stridor.view.depth_picture import Camera, sharp_edges, surface_picture
from stridor.view.field_plots import MAP_COLOURS, contact_map, contact_snapshot, interface_energy
from stridor.view.interface_columns import arc_length, columns_along
from stridor.view.mode_motion import QUANTA
from stridor.view.mode_page import COLOURS
from stridor.view.shape_plots import model_plot
from stridor.view.skin import normals, skin_of, surface_facets
from stridor.view.style import lay_out

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)


def own_rows(start: int, count: int, size: int) -> Rows:
    """Each displacement is a freedom of its own."""
    free = sp.csr_array((np.ones(count), (np.arange(count), start + np.arange(count))), shape=(count, size))
    return Rows(free, np.zeros((count, 0)))


def made(parts, dimension: int, *, lines=(), contact=None) -> System:
    """A System of (points, cells) and lines; contact: nodes of the first solid that are slaves, on nothing."""
    size = sum(p.size for p, _ in parts) + sum(c.size for c in lines)
    start, solids, drawn = 0, [], []
    for k, (points, cells) in enumerate(parts, start=1):
        own = np.arange(start, start + points.size)
        solids.append(Solid(f"body{k}", points, cells, own_rows(start, points.size, size), own))
        start += points.size
    for k, coordinates in enumerate(lines, start=1):
        own = np.arange(start, start + coordinates.size)
        drawn.append(Line(f"beam{k}", coordinates, own_rows(start, coordinates.size, size), own))
        start += coordinates.size
    surfaces = () if contact is None else (sliding(solids[0], contact, size),)
    unit = sp.eye_array(size, format="csr")
    return System(unit, unit, unit, dimension=dimension, solids=tuple(solids), lines=tuple(drawn), surfaces=surfaces)


def sliding(solid: Solid, nodes, size: int) -> SurfaceContact:
    """Slave nodes on a fixed floor."""
    d = solid.points.shape[1]
    at = solid.points[nodes]
    take = (np.asarray(nodes)[:, None] * d + np.arange(d)).ravel()
    slave = Rows(sp.csr_array(solid.rows.free[take]), solid.rows.lift[take])
    none = np.zeros((len(at), 0), dtype=np.int64)
    normal = np.tile(np.eye(d)[-1], (len(at), 1))
    place = Location(none, none.astype(float), at, normal, np.zeros(len(at)), none.sum(axis=1), np.ones(len(at), bool))
    common = {
        "slave": slave,
        "slave_position": at,
        "area": np.full(len(at), 1e-6),
        "master_rows": Rows(sp.csr_array((0, size)), np.zeros((0, 0))),
        "drift": np.zeros((len(at), d, 0)),
        "stiffness_per_area": np.inf,
        "law": Coulomb(0.3),
        "location": place,
    }
    return SurfaceContact(
        name="floor", master=None, sliding="small", nodes=operators("floor", **common), **common
    )  # fmt: skip


def boxes(counts, size, *, at=(0.0, 0.0, 0.0)):
    """A regular mesh of a box: points and hexahedra."""
    axes = [o + s * np.arange(n + 1) / n for n, s, o in zip(counts, size, at, strict=True)]
    points = np.column_stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")])
    number = np.arange(len(points)).reshape([n + 1 for n in counts])
    nx, ny, nz = counts
    corner = [number[int(i) : nx + int(i), int(j) : ny + int(j), int(k) : nz + int(k)].ravel() for i, j, k in CUBE]
    return points, {"hexahedron": np.column_stack(corner)}


def plates(nx, ny, size=(0.1, 0.02), at=(0.0, 0.0), *, triangles=False):
    """A regular mesh of a rectangle."""
    x, y = (o + s * np.arange(n + 1) / n for n, s, o in zip((nx, ny), size, at, strict=True))
    points = np.column_stack([g.ravel() for g in np.meshgrid(x, y, indexing="ij")])
    number = np.arange(len(points)).reshape(nx + 1, ny + 1)
    quads = np.column_stack([a.ravel() for a in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])])
    if triangles:
        return points, {"triangle": np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])}
    return points, {"quad": quads}


@cache
def plane_system() -> System:
    """Two plates and a beam, three slave nodes."""
    beam = np.column_stack([np.full(6, 0.05), np.linspace(0.05, 0.1, 6)])
    parts = [plates(8, 2), plates(3, 4, (0.03, 0.03), (0.03, 0.02), triangles=True)]
    return made(parts, 2, lines=[beam], contact=[0, 3, 6])


@cache
def space_system() -> System:
    """A small box on a plate, the slave nodes under it."""
    block = boxes((2, 2, 2), (0.02, 0.02, 0.02), at=(0.02, 0.01, 0.01))
    return made([block, boxes((6, 4, 1), (0.06, 0.04, 0.01))], 3, contact=[0, 3, 6, 9])


def history(position, tangents, *, records=40, area=1e-6, status=None, names=("pad",), owner=None) -> NodeHistory:
    """Records 1 ms apart: normal force 1 N times the node's number plus one, slip velocity 0.1 m/s."""
    count, d = position.shape
    force = np.tile(1.0 + np.arange(count), (records, 1))
    slip = np.zeros((records, count, d - 1))
    slip[:, :, 0] = 0.1
    return NodeHistory(
        names=names,
        owner=np.zeros(count, dtype=int) if owner is None else owner,
        position=position,
        area=np.full(count, area),
        tangents=tangents,
        time=1e-3 * np.arange(records),
        normal_force=force,
        tangential_force=0.3 * slip,
        slip_velocity=slip,
        gap=np.zeros((records, count)),
        status=np.full((records, count), 2) if status is None else status,
    )


def on_line(count=11):
    """Nodes on the x axis in a mixed order, tangents along x."""
    x = np.random.default_rng(3).permutation(np.arange(count)) * 1e-3
    return np.column_stack([x, 0 * x]), np.tile([[[1.0, 0.0]]], (count, 1, 1))


def ring(angles, radii=(0.09, 0.1), centre=(0.2, 0.0)):
    """Nodes of a flat ring about an axis along z, first tangents around."""
    radius, angle = (g.ravel() for g in np.meshgrid(radii, angles, indexing="ij"))
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    first = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    return out * radius[:, None] + [*centre, 0.0], np.stack([first, np.cross([0, 0, 1.0], first)], axis=1), angle


def drawn(figure: Figure) -> bytes:
    """The picture, so that what only fails while drawing fails here."""
    held = io.BytesIO()
    figure.savefig(held, format="png", dpi=60)
    return held.getvalue()


def shown_map(figure: Figure) -> QuadMesh:
    """The coloured field of a space–time picture."""
    return next(c for c in figure.axes[0].collections if isinstance(c, QuadMesh))


# -- what can be seen of a mesh ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("counts", "outer"), [((1, 1, 1), 6), ((2, 3, 4), 2 * (6 + 8 + 12)), ((5, 1, 1), 22)])
def test_outer_facets_of_a_box(counts, outer):
    points, cells = boxes(counts, (1.0, 1.0, 1.0))
    facets = surface_facets(cells, 3)
    assert len(facets) == outer
    # Outward: away from the middle of the box.
    assert np.all(np.sum(normals(points, facets) * (points[facets].mean(axis=1) - 0.5), axis=1) > 0)


def test_outer_facets_of_tetrahedra():
    # Five tetrahedra in a cube: four at its corners, one inside; each side of the cube is two triangles.
    cells = np.array([[0, 1, 3, 4], [2, 3, 1, 6], [5, 4, 6, 1], [7, 6, 4, 3], [1, 3, 4, 6]])
    flipped = np.linalg.det(CUBE[cells[:, 1:]] - CUBE[cells[:, :1]]) < 0
    cells[flipped] = cells[flipped][:, [0, 2, 1, 3]]
    facets = surface_facets({"tetra": cells}, 3)
    assert len(facets) == 12
    assert np.all(facets[:, 2] == facets[:, 3])
    assert np.all(np.sum(normals(CUBE, facets) * (CUBE[facets[:, :3]].mean(axis=1) - 0.5), axis=1) > 0)
    # Ten nodes to a cell: the middle ones do not matter.
    more = np.column_stack([cells, np.full((5, 6), 99)])
    assert np.array_equal(surface_facets({"tetra10": more}, 3), facets)


def test_quadratic_hexahedra_share_facets_with_linear_ones():
    _, cells = boxes((2, 1, 1), (2.0, 1.0, 1.0))
    first, second = cells["hexahedron"]
    mixed = {"hexahedron": first[None], "hexahedron20": np.concatenate([second, np.full(12, 77)])[None]}
    assert len(surface_facets(mixed, 3)) == 10


def test_kinds_that_cannot_be_drawn_are_named():
    with pytest.raises(CaseError, match=r"wedge.*not a kind that can be drawn in 3D"):
        surface_facets({"wedge": np.zeros((1, 6), dtype=int)}, 3)
    with pytest.raises(CaseError, match=r"tetra.*2D; known: triangle, triangle6, quad, quad8, quad9"):
        surface_facets({"tetra": np.zeros((1, 4), dtype=int)}, 2)


def test_skin_carries_the_motion_to_the_points():
    system = space_system()
    vector = np.arange(system.size) * (1 + 2j)
    skin = skin_of(system, vector)
    assert skin.closed
    assert skin.names == ("body1", "body2")
    everything = np.concatenate([s.points for s in system.solids])
    moved = vector.reshape(-1, 3)
    for at, motion in zip(skin.points, skin.motion, strict=True):
        same = np.flatnonzero(np.all(everything == at, axis=1))
        assert any(np.array_equal(moved[k], motion) for k in same)
    # Nodes inside a body are not carried along: the block has one.
    assert len(skin.points) == len(everything) - 1


def test_vectors_that_do_not_fit_are_refused():
    system = plane_system()
    with pytest.raises(CaseError, match=rf"vector.*\(3,\).*one value for each of {system.size} freedoms"):
        skin_of(system, np.zeros(3))
    with pytest.raises(CaseError, match="not finite"):
        skin_of(system, np.full(system.size, np.nan))
    with pytest.raises(CaseError, match="neither solids nor lines"):
        skin_of(System(*(sp.eye_array(2, format="csr"),) * 3))


def beside_a_mass(dimension: int, *, line: bool = False) -> System:
    """A point mass above a plate or a box, listed before it, and a beam or none."""
    beam = np.column_stack([np.full(3, 0.05), np.linspace(0.05, 0.1, 3)])
    body = plates(4, 2) if dimension == 2 else boxes((2, 2, 2), (0.02, 0.02, 0.02))
    mass = np.array([[0.01, 0.05, 0.04][:dimension]]), {"vertex": np.zeros((1, 1), dtype=np.int64)}
    return made([mass, body], dimension, lines=[beam] if line else [])


@pytest.mark.parametrize(("dimension", "line"), [(2, False), (2, True), (3, False)])
def test_point_masses_are_dots_that_move(dimension, line):
    system = beside_a_mass(dimension, line=line)
    vector = np.zeros(system.size, dtype=complex)
    vector[:dimension] = (1e-6 + 1e-6j) * np.arange(1, dimension + 1)
    skin = skin_of(system, vector)
    assert skin.names == ("body2", "body1", *(["beam1"] if line else []))
    assert skin.segment_body[skin.lone].tolist() == [1]
    at = skin.segments[skin.lone[0], 0]
    assert np.array_equal(skin.points[at], system.solids[0].points[0])
    assert np.array_equal(skin.motion[at], vector[:dimension])
    assert np.count_nonzero(skin.motion) == dimension
    assert skin.closed == (dimension == 3)
    figure = solid_plots.mode_shape(system, vector)
    rest, moved = (d for d in figure.axes[0].collections if isinstance(d, PathCollection))
    assert to_rgba(np.asarray(moved.get_facecolor())[0]) == pytest.approx(mpl.colormaps["viridis"](1.0))
    assert np.linalg.norm(np.asarray(moved.get_offsets()) - np.asarray(rest.get_offsets())) > 0
    drawn(figure)
    legend = solid_plots.mesh(system).axes[0].get_legend()
    assert [t.get_text() for t in legend.get_texts()] == list(skin.names)
    data = page_of(animation_html(system, vector, frequency_hz=10.0))
    assert data["meshed"] == 1
    ends = unpacked(data, "segments", "<u2").reshape(-1, 2)
    assert ends[ends[:, 0] == ends[:, 1]].tolist() == [[at, at]]
    assert animation_gif(system, vector, frequency_hz=10.0, frames=2).startswith(b"GIF")


def test_beams_and_a_mass_are_drawn_and_masses_alone_are_no_shape():
    beam = np.column_stack([np.linspace(0.0, 0.1, 3), np.zeros(3)])
    mass = np.array([[0.1, 0.05]]), {"vertex": np.zeros((1, 1), dtype=np.int64)}
    system = made([mass], 2, lines=[beam])
    drawn(solid_plots.mode_shape(system, np.ones(system.size)))
    at = [line.get_xydata().tolist() for line in model_plot(system).axes[0].lines]
    assert [[100.0, 50.0]] in at  # mm
    with pytest.raises(CaseError, match="neither solids nor lines"):
        skin_of(made([mass], 2))


# -- pictures of solids ------------------------------------------------------------------------------------------------


def test_mesh_in_the_plane_draws_every_cell_in_its_bodys_colour():
    figure = solid_plots.mesh(plane_system())
    cells = next(c for c in figure.axes[0].collections if isinstance(c, PolyCollection))
    assert len(cells.get_paths()) == 16 + 24
    assert len(np.unique(cells.get_facecolor(), axis=0)) == 2
    beam = next(c for c in figure.axes[0].collections if isinstance(c, LineCollection))
    assert len(beam.get_segments()) == 5
    nodes = next(c for c in figure.axes[0].collections if isinstance(c, PathCollection))
    assert np.allclose(nodes.get_offsets(), [[0, 0], [12.5, 0], [25, 0]])
    words = [t.get_text() for t in figure.axes[0].get_legend().get_texts()]
    assert words == ["body1", "body2", "beam1", "3 contact nodes"]
    assert drawn(figure)


def test_mesh_in_space_shows_both_bodies():
    figure = solid_plots.mesh(space_system())
    image = figure.axes[0].images[0].get_array()
    solid = image[image[..., 3] > 0.99][:, :3]
    # Blue has more blue than red, orange the other way round; nothing else is there.
    blue, orange = solid[:, 2] > solid[:, 0], solid[:, 0] > solid[:, 2]
    assert blue.sum() > 20_000
    assert orange.sum() > 10_000
    assert blue.sum() + orange.sum() == len(solid)
    assert drawn(figure)


def test_mode_shape_moves_as_far_as_asked_and_names_the_mode():
    system = plane_system()
    vector = np.zeros(system.size, dtype=complex)
    vector[1::2] = 1e-6j  # every point up; the phase does not matter
    figure = solid_plots.mode_shape(system, vector, scale=1e4, frequency_hz=4321.0, growth_rate=73.0)
    ax = figure.axes[0]
    assert ax.get_title(loc="left") == "4.321 kHz, growth rate +73 1/s (unstable: grows)"
    beam = [c for c in ax.collections if isinstance(c, LineCollection) and len(c.get_segments()) == 5]
    top = np.concatenate(beam[0].get_segments())[:, 1].max()
    assert abs(abs(top - 100.0) - 10.0) < 1e-9  # 1e-6 m times 1e4 is 10 mm
    smooth = next(c for c in ax.collections if type(c).__name__ == "TriMesh")
    assert np.allclose(smooth.get_array(), 1.0)
    quarter = solid_plots.mode_shape(system, vector, scale=1e4, phase=np.pi / 2)
    smooth = next(c for c in quarter.axes[0].collections if type(c).__name__ == "TriMesh")
    assert np.allclose(smooth.get_array(), 0.0, atol=1e-12)
    assert drawn(figure)
    with pytest.raises(CaseError, match="scale: nan"):
        solid_plots.mode_shape(system, vector, scale=float("nan"))


def test_mode_shape_in_space_colours_what_moves():
    system = space_system()
    vector = np.zeros(system.size)
    vector[system.solids[0].freedoms[2::3]] = 1.0  # the block moves up, the plate rests
    image = solid_plots.mode_shape(system, vector).axes[0].images[0].get_array()
    solid = image[image[..., 3] > 0.99][:, :3]
    # viridis is dark violet at rest and bright yellow at the largest motion.
    moving, resting = solid[:, 1] > 1.5 * solid[:, 2], solid[:, 2] > 1.5 * solid[:, 1]
    assert moving.sum() > 10_000
    assert resting.sum() > 20_000
    assert moving.sum() + resting.sum() > 0.98 * len(solid)  # pixels on the border between them are mixed


def test_drawings_leave_the_readers_style_alone_and_take_plane_axes():
    before = dict(mpl.rcParams)
    given = Figure().subplots()
    assert solid_plots.mesh(space_system(), ax=given) is given.figure
    assert dict(mpl.rcParams) == before
    with pytest.raises(CaseError, match="plane axes"):
        solid_plots.mesh(space_system(), ax=Figure().add_subplot(projection="3d"))


def test_depth_decides_what_is_seen_whatever_the_order():
    # A small square above a large one, both facing the eye; centres sort them the wrong way round once it is lifted
    # only a little over the near end of a tilted large one.
    camera = Camera.at(90.0, -90.0)
    assert np.allclose([camera.right, camera.up, camera.toward], np.eye(3), atol=1e-12)
    seen = np.array([[0, 0, 0], [4, 0, 3], [4, 4, 3], [0, 4, 0], [0, 1, 1.3], [1, 1, 1.3], [1, 2, 1.3], [0, 2, 1.3]])
    red, green = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    colours = np.array([[red] * 4, [green] * 4])
    facets = np.array([[0, 1, 2, 3], [4, 5, 6, 7]])
    for order in ([0, 1], [1, 0]):
        image = surface_picture(
            seen, facets[order], colours[order], np.zeros(2), np.full(2, 4.0), pixels=40, lines=False
        )
        assert image.shape == (40, 40, 4)
        assert np.all(image[..., 3] == 1.0)
        upright = image[::-1]
        inside = upright[11:19, 1:9]  # 0.1 to 0.9 across, 1.1 to 1.9 up
        assert np.all(inside[..., 1] > 0.5)
        assert np.all(inside[..., 0] == 0.0)
        assert np.all(upright[:, 11:, 0] > 0.5)
    nothing = surface_picture(seen + 100.0, facets, colours, np.zeros(2), np.full(2, 4.0), pixels=40, lines=True)
    assert not nothing.any()


def test_sharp_edges_sketch_a_box():
    points, cells = boxes((2, 2, 2), (1.0, 1.0, 1.0))
    assert len(sharp_edges(points, surface_facets(cells, 3))) == 12 * 2


def test_twenty_thousand_facets_are_drawn_in_time_and_stay_small():
    system = made([boxes((70, 70, 35), (1.0, 1.0, 0.2))], 3)
    vector = np.sin(np.arange(system.size) * 0.01)
    begin = time.process_time()
    skin = skin_of(system, vector)
    assert len(skin.facets) == 2 * 4900 + 4 * 2450
    figure = solid_plots.draw_frame(skin, phase=0.0, scale=None, view=(28.0, -58.0), title="")
    held = io.BytesIO()
    figure.savefig(held, format="svg")
    assert time.process_time() - begin < 10.0
    assert held.tell() < 2e6
    assert len(animation_html(system, vector, frequency_hz=1.0)) < 1.3e6


# -- motion ------------------------------------------------------------------------------------------------------------


def page_of(html: str) -> dict:
    """The data that the page's script reads."""
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', html, re.DOTALL)
    assert found
    return json.loads(found.group(1))


def unpacked(data: dict, name: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(data[name]), dtype=kind)


def travelling(system: System) -> np.ndarray:
    """A wave along x, motion along z."""
    vector = np.zeros((system.size // 3, 3), dtype=complex)
    x = np.concatenate([s.points for s in system.solids])[:, 0]
    vector[:, 2] = 2e-6 * np.exp(-100j * x)
    return vector.ravel()


def test_page_holds_the_complex_motion():
    system = space_system()
    vector = travelling(system)
    html = animation_html(system, vector, frequency_hz=4321.0, growth_rate=-20.0, scale=1e3)
    data, skin = page_of(html), skin_of(system, vector)
    assert data["names"] == ["body1", "body2"]
    assert len(unpacked(data, "facets", "<u2")) == 4 * len(skin.facets)
    assert np.bincount(unpacked(data, "body", "u1")).tolist() == [24, 2 * (24 + 6 + 4)]
    assert np.isclose(data["scale"], 2e-3)  # 2e-6 m drawn 1000 times as large
    points = unpacked(data, "points", "<f4").reshape(-1, 3)
    assert np.allclose(points + (skin.points.min(axis=0) + skin.points.max(axis=0)) / 2, skin.points, atol=1e-7)
    motion = (unpacked(data, "real", "<i2") + 1j * unpacked(data, "imag", "<i2")).reshape(-1, 3) / QUANTA
    turn = motion[0, 2] / (skin.motion[0, 2] / 2e-6)
    assert np.isclose(abs(turn), 1.0, atol=1e-4)
    assert np.allclose(motion, turn * skin.motion / 2e-6, atol=1e-4)  # every phase, so that the wave travels


def test_colours_of_the_page_are_those_of_the_figures():
    shades = mpl.colormaps[solid_plots.AMPLITUDES](np.linspace(0.0, 1.0, len(COLOURS)))
    assert list(COLOURS) == [to_hex(shade) for shade in shades]
    data = page_of(animation_html(space_system(), travelling(space_system()), frequency_hz=4321.0))
    assert data["ramp"] == [[round(255 * v) for v in shade[:3]] for shade in shades]
    assert data["colours"] == [[round(255 * v) for v in to_rgb(solid_plots.body_colour(k))] for k in range(2)]


def test_page_needs_nothing_else_and_says_how_the_mode_grows():
    system = space_system()
    growing = animation_html(system, travelling(system), frequency_hz=4321.0, growth_rate=np.log(10) / 0.02)
    assert "unstable: growth rate +115.1 1/s, ten times as large after 20 ms" in growing
    assert "4.321 kHz" in growing
    assert not re.search(r"https?://|src=|@import|<link", growing)
    decaying = animation_html(system, travelling(system), frequency_hz=10.0, growth_rate=-1.0)
    assert "stable: growth rate -1 1/s, a tenth after 2.3 s" in decaying
    risky = animation_html(system, travelling(system), frequency_hz=10.0, title="</script><b>")
    assert "</script><b>" not in risky


def test_plane_system_and_its_beam_are_in_the_page():
    system = plane_system()
    data = page_of(animation_html(system, np.ones(system.size), frequency_hz=10.0))
    assert data["dimension"] == 2
    assert not data["closed"]
    assert len(unpacked(data, "segments", "<u2")) == 10
    assert unpacked(data, "segment_body", "u1").tolist() == [2] * 5
    assert data["meshed"] == 2


STUB = """
const made = {};
const node = (id) => made[id] ??= { id, value: {amplitude: "1", speed: "0.6", colours: COLOURS}[id], style: {},
  textContent: id === "data" ? DATA : "", clientWidth: 300, clientHeight: 200, addEventListener() {}, append() {},
  replaceChildren() {}, getContext: () => context };
const context = { createImageData: (w, h) => ({ data: new Uint8ClampedArray(4 * w * h) }), beginPath() {}, moveTo() {},
  lineTo() {}, stroke() { strokes++; }, arc(x, y) { dots.push([x, y]); }, fill() {}, putImageData(image) { shown = new Uint32Array(image.data.buffer); } };
let strokes = 0, dots = [], shown = null, waiting = null;
globalThis.document = { getElementById: node, createElement: () => ({ style: {}, append() {} }) };
globalThis.window = { devicePixelRatio: 1, addEventListener() {} };
globalThis.matchMedia = () => ({ matches: true });
globalThis.ResizeObserver = class { observe() {} };
globalThis.requestAnimationFrame = (f) => { waiting = f; };
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="the page's script is run with node")
@pytest.mark.parametrize("colours", ["size", "body"])
def test_script_of_the_page_draws(colours, tmp_path):
    system = space_system() if colours == "body" else plane_system()
    html = animation_html(system, np.ones(system.size), frequency_hz=10.0)
    script = html[html.index('"use strict"') : html.rindex("</script>")]
    head = STUB.replace("COLOURS", json.dumps(colours)).replace("DATA", json.dumps(json.dumps(page_of(html))))
    tail = "\nwaiting(0);\nconst c = {}; for (const p of shown) c[p] = (c[p] || 0) + 1;"
    tail += "\nconsole.log(JSON.stringify({ strokes, colours: c }));"
    file = tmp_path / "page.js"
    file.write_text(head + "{" + script + "}" + tail, encoding="utf-8")
    done = subprocess.run(["node", str(file)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    painted = {int(k): v for k, v in found["colours"].items() if int(k) != 0xFFFFFFFF}
    assert sum(painted.values()) > 3000  # of 60 000 pixels
    if colours == "body":
        # The canvas stores blue, green, red: both bodies are there.
        bluish = sum(v for k, v in painted.items() if (k >> 16 & 255) > (k & 255))
        assert 1000 < bluish < sum(painted.values()) - 1000
    else:
        assert found["strokes"] == 5  # the beam's pieces
        # Everything moves alike: one colour, and that of the mesh on it.
        assert len(painted) == 2


@pytest.mark.skipif(shutil.which("node") is None, reason="the page's script is run with node")
def test_script_of_the_page_draws_point_masses(tmp_path):
    """A line from a point to itself is none on a canvas."""
    system = beside_a_mass(2, line=True)
    html = animation_html(system, np.ones(system.size), frequency_hz=10.0)
    script = html[html.index('"use strict"') : html.rindex("</script>")]
    head = STUB.replace("COLOURS", json.dumps("size")).replace("DATA", json.dumps(json.dumps(page_of(html))))
    file = tmp_path / "page.js"
    tail = "\nwaiting(0);\nconsole.log(JSON.stringify({ strokes, dots }));"
    file.write_text(head + "{" + script + "}" + tail, encoding="utf-8")
    done = subprocess.run(["node", str(file)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["strokes"] == 2  # the beam's pieces
    ((x, y),) = found["dots"]
    assert 0 < x < 300
    assert 0 < y < 200


def test_gif_has_the_frames_of_one_cycle():
    system = plane_system()
    vector = np.zeros(system.size)
    vector[1::2] = 1.0
    held = Image.open(io.BytesIO(animation_gif(system, vector, frequency_hz=10.0, frames=4)))
    assert held.n_frames == 4
    assert held.info["loop"] == 0
    pictures = []
    for k in range(4):
        held.seek(k)
        pictures.append(np.asarray(held.convert("RGB"), dtype=int))
    assert pictures[0][0, 0].tolist() == [255, 255, 255]
    changed = [np.count_nonzero(np.abs(a - b).sum(axis=2) > 60) for a, b in itertools.pairwise(pictures)]
    assert min(changed) > 500
    # A quarter and three quarters of a period both pass through rest.
    assert np.count_nonzero(np.abs(pictures[1] - pictures[3]).sum(axis=2) > 60) < 0.1 * min(changed)
    with pytest.raises(CaseError, match="frames: 1"):
        animation_gif(system, vector, frequency_hz=10.0, frames=1)


# -- where nodes are along a contact -----------------------------------------------------------------------------------


def test_arc_length_follows_the_line_and_the_tangents():
    angle = np.random.default_rng(1).permutation(np.linspace(-2.5, 2.5, 80))  # most of a circle
    position = 0.1 * np.column_stack([np.sin(angle), np.cos(angle)])
    tangents = np.column_stack([np.cos(angle), -np.sin(angle)])[:, None]
    along = arc_length(position, tangents)
    assert np.array_equal(np.argsort(along), np.argsort(angle))
    assert np.isclose(along.max(), 0.1 * 5.0, rtol=1e-3)
    assert np.allclose(arc_length(position, -tangents), along.max() - along)
    assert arc_length(np.array([[3.0, 1.0]])).tolist() == [0.0]


def test_columns_in_space():
    position, tangents, angle = ring(np.linspace(-0.3, 0.4, 8))
    columns = columns_along(position, tangents, about=np.array([0.2, 0.0, 0.0]))
    assert columns.count == 8
    assert np.allclose(np.diff(columns.edges), np.degrees(0.1))
    assert np.allclose(np.abs(np.diff(columns.value)), np.abs(np.diff(np.degrees(angle))))
    assert columns_along(position, tangents).label == "position along the direction of sliding [mm]"
    chosen = columns_along(position, tangents, along=np.array([2.0, 0.0, 0.0]))
    assert np.allclose(chosen.value, 1e3 * position[:, 0])
    for bad in ({"along": np.zeros(3)}, {"about": np.zeros(2)}):
        with pytest.raises(CaseError, match=next(iter(bad))):
            columns_along(position, tangents, **bad)


def test_a_whole_ring_is_shown_over_the_angle_about_the_centre_it_turns_round():
    position, tangents, angle = ring(np.linspace(-np.pi, np.pi, 24, endpoint=False) + 0.01)
    columns = columns_along(position, tangents)
    assert columns.label == "angle about the axis of sliding [°]"
    assert columns.count == 24
    # Both radii of one angle fall in one column, and neighbours differ by 15°: the centre was found.
    assert np.array_equal(columns.column[:24], columns.column[24:])
    assert np.allclose(np.diff(np.sort(columns.value)[::2]), 15.0, atol=1e-6)
    assert len(angle) == 48


# -- pictures of the contact -------------------------------------------------------------------------------------------


def test_pressure_map_is_in_order_and_in_megapascal():
    position, tangents = on_line()
    figure = contact_map(history(position, tangents), quantity="pressure")
    field = shown_map(figure)
    values = np.asarray(field.get_array())
    assert values.shape == (40, 11)
    # Node k presses with k + 1 newton on one square millimetre: k + 1 MPa, at its place.
    assert np.allclose(values[7], (1.0 + np.arange(11))[np.argsort(position[:, 0])])
    assert figure.axes[1].get_ylabel() == "pressure [MPa]"
    assert np.allclose(field.get_coordinates()[0, :, 0], np.arange(12) - 0.5)
    assert np.allclose(field.get_coordinates()[[0, -1], 0, 1], [0.0, 40.0])  # ms
    points = contact_map(history(position, tangents, area=np.nan))
    assert points.axes[1].get_ylabel() == "normal force [N]"
    assert drawn(figure)


def test_status_map_has_three_colours_and_their_names():
    position, tangents = on_line()
    status = np.full((40, 11), 2)
    status[10:20, 3] = 1
    status[15:25, 5] = 0
    figure = contact_map(history(position, tangents, status=status), quantity="status")
    field = shown_map(figure)
    place = np.argsort(np.argsort(position[:, 0]))
    values = np.asarray(field.get_array())
    assert np.count_nonzero(values == 1) == 10
    assert np.all(values[10:20, place[3]] == 1)
    assert np.all(values[15:25, place[5]] == 0)
    painted = field.cmap(field.norm(np.array([0, 1, 2])))
    assert np.allclose(painted, [to_rgba(MAP_COLOURS[n]) for n in ("separation", "stick", "slip")])
    legend = figure.axes[0].get_legend()
    assert [t.get_text() for t in legend.get_texts()] == ["separation", "stick", "slip"]
    colours = [to_rgb(p.get_facecolor()) for p in legend.get_patches()]
    assert np.allclose(colours, [to_rgb(MAP_COLOURS[n]) for n in ("separation", "stick", "slip")])


def test_long_histories_lose_rows_but_no_event():
    position, tangents = on_line(3)
    status = np.full((30_000, 3), 2)
    status[20_001, 1] = 0  # one record
    status[5_000:5_003, 0] = 1
    run = history(position, tangents, records=30_000, status=status)
    gap = np.zeros((30_000, 3))
    gap[20_001, 1] = 3e-6
    run = NodeHistory(**{**run.__dict__, "gap": gap})
    values = np.asarray(shown_map(contact_map(run, quantity="status")).get_array())
    assert values.shape == (1500, 3)
    assert np.count_nonzero(values == 0) == 1
    assert np.count_nonzero(values == 1) == 1
    opened = np.asarray(shown_map(contact_map(run, quantity="gap")).get_array())
    assert np.isclose(opened.max(), 3.0)  # µm, not the mean over the row
    pressure = np.asarray(shown_map(contact_map(run)).get_array())
    assert np.allclose(np.sort(pressure[0]), [1.0, 2.0, 3.0])
    part = shown_map(contact_map(run, quantity="status", start=20.0, end=20.1))
    assert np.asarray(part.get_array()).shape == (101, 3)


def test_columns_in_space_take_force_over_area_and_the_most_frequent_status():
    position, tangents, _ = ring(np.linspace(-0.3, 0.3, 5), radii=(0.09, 0.1, 0.11))
    status = np.full((4, 15), 2)
    status[:, :5] = 1  # one of three nodes in each column
    run = history(position, tangents, records=4, status=status)
    area = np.where(np.arange(15) < 5, 0.0, 1e-6)  # corner nodes of quadratic facets stand for no area
    run = NodeHistory(**{**run.__dict__, "area": area})
    centre = (0.2, 0.0, 0.0)
    values = np.asarray(shown_map(contact_map(run, about=centre)).get_array())
    assert values.shape == (4, 5)
    force = (1.0 + np.arange(15)).reshape(3, 5).sum(axis=0)
    assert np.allclose(values[0], force / 2)
    assert np.all(np.asarray(shown_map(contact_map(run, quantity="status", about=centre)).get_array()) == 2)


def test_slip_map_keeps_the_sign():
    position, tangents = on_line()
    run = history(position, tangents)
    field = shown_map(contact_map(NodeHistory(**{**run.__dict__, "slip_velocity": -run.slip_velocity}), quantity="slip"))
    assert np.allclose(field.get_array(), -0.1)
    assert (field.norm.vmin, field.norm.vmax) == (-0.1, 0.1)


def test_a_contact_is_chosen_by_name_and_wrong_ones_are_named():
    position, tangents = on_line(6)
    run = history(position, tangents, names=("a", "b"), owner=np.array([0, 0, 1, 1, 1, 1]))
    assert np.asarray(shown_map(contact_map(run, "b")).get_array()).shape == (40, 4)
    assert np.asarray(shown_map(contact_map(run)).get_array()).shape == (40, 2)
    for message, call in {
        "contact: 'c' – no such contact; known: a, b": lambda: contact_map(run, "c"),
        "quantity: 'heat' – unknown; known: pressure, status, slip, gap": lambda: contact_map(run, quantity="heat"),
        "no record lies there; the history is 0 to 0.039 s": lambda: contact_map(run, start=1.0),
        "at: 3.0 – a time of this history: 0 to 0.039 s": lambda: contact_snapshot(run, 3.0),
    }.items():
        with pytest.raises(CaseError, match=re.escape(message)):
            call()


def test_snapshot_in_the_plane_marks_each_status():
    position, tangents = on_line()
    status = np.full((40, 11), 2)
    status[12, :4], status[12, 4:6] = 1, 0
    figure = contact_snapshot(history(position, tangents, status=status), 0.0121)
    marks = {c.get_label(): c for c in figure.axes[0].collections if isinstance(c, PathCollection)}
    assert {name: len(c.get_offsets()) for name, c in marks.items()} == {"slip": 5, "stick": 4, "separation": 2}
    assert np.allclose(np.sort(np.asarray(marks["stick"].get_offsets())[:, 0]), np.sort(1e3 * position[:4, 0]))
    assert np.allclose(to_rgb(marks["stick"].get_facecolor()[0]), to_rgb(MAP_COLOURS["stick"]))
    assert figure.axes[0].get_title(loc="left") == "contact pad at 12 ms"


def test_snapshot_in_space_leaves_the_hole_of_a_ring_open():
    position, tangents, _ = ring(np.linspace(-np.pi, np.pi, 36, endpoint=False))
    figure = contact_snapshot(history(position, tangents), 0.0)
    surface = next(c for c in figure.axes[0].collections if type(c).__name__ == "TriMesh")
    triangles = surface._triangulation.get_masked_triangles()
    points = np.column_stack([surface._triangulation.x, surface._triangulation.y])
    middle = np.linalg.norm(points[triangles].mean(axis=1), axis=1)
    assert len(triangles) == 72
    assert middle.min() > 85.0
    assert drawn(figure)


def test_energy_shows_where_the_motion_is_fed():
    position, tangents = on_line(5)
    energy = 1e-6 * np.array([2.0, -1.0, 0.5, -0.5, 3.0])
    figure = interface_energy(position, energy, tangents=tangents)
    ax = figure.axes[0]
    dots = next(c for c in ax.collections if isinstance(c, PathCollection))
    assert np.allclose(dots.get_offsets(), np.column_stack([1e3 * position[:, 0], 1e6 * energy]))
    red = dots.get_facecolor()[:, 0] > dots.get_facecolor()[:, 2]
    assert red.tolist() == [True, False, True, False, True]
    assert ax.get_ylabel() == "friction energy per cycle [µJ]"
    assert ax.get_title(loc="left") == "friction energy per cycle: +4 µJ in total"
    bare = interface_energy(position, energy, tangents=tangents, quantity="share", unit="").axes[0]
    assert bare.get_ylabel() == "share"
    assert bare.get_title(loc="left") == "share: +4e-06 in total"
    place, along, _ = ring(np.linspace(-0.3, 0.3, 5))
    dots = interface_energy(place, np.linspace(-2e-3, 1e-3, 10), tangents=along).axes[0].collections[0]
    drawn(dots.figure)
    colours = dots.get_facecolor()
    assert colours[0, 2] > colours[0, 0]
    assert colours[-1, 0] > colours[-1, 2]
    assert (dots.norm.vmin, dots.norm.vmax) == (-2.0, 2.0)  # mJ, zero in the middle
    with pytest.raises(CaseError, match="one energy"):
        interface_energy(position, energy[:3])
    assert field_plots._prefix(np.array([999.0]))[1] == ""
    assert field_plots._prefix(np.array([0.0]))[1] == ""


# -- files -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_vtk_holds_bodies_motion_and_contact(suffix, tmp_path):
    system = plane_system()
    vector = np.arange(system.size) * (1 - 2j)
    solid_points = sum(len(s.points) for s in system.solids)
    paths = write_vtk(
        system,
        tmp_path / f"deep/mode{suffix}",
        vectors={"mode": vector, "static": vector.real},
        point_data={"temperature": np.arange(solid_points)},
        cell_data={"stress": np.arange(45.0)},
        contact_data={"pressure": np.array([1.0, 2.0, 3.0]), "status": np.array([0, 1, 2])},
    )
    assert [p.name for p in paths] == [f"mode{suffix}", f"mode-contact{suffix}"]
    assert sorted(p.name for p in (tmp_path / "deep").iterdir()) == sorted(p.name for p in paths)  # nothing half-made
    mesh, contact = (meshio.read(p) for p in paths)
    everything = np.concatenate([*(s.points for s in system.solids), system.lines[0].coordinates])
    assert np.array_equal(mesh.points, np.pad(everything, ((0, 0), (0, 1))))
    assert [(c.type, len(c.data)) for c in mesh.cells] == [("quad", 16), ("triangle", 24), ("line", 5)]
    assert mesh.cells[1].data.min() == len(system.solids[0].points)
    expected = np.pad(vector.reshape(-1, 2), ((0, 0), (0, 1)))
    assert np.array_equal(mesh.point_data["mode_real"] + 1j * mesh.point_data["mode_imag"], expected)
    assert np.allclose(mesh.point_data["mode_magnitude"], np.linalg.norm(expected, axis=1))
    assert np.array_equal(mesh.point_data["static"], expected.real)
    assert np.array_equal(mesh.point_data["temperature"][:solid_points], np.arange(solid_points))
    assert np.all(np.isnan(mesh.point_data["temperature"][solid_points:]))
    assert [b.ravel()[0] for b in mesh.cell_data["body"]] == [1, 2, 3]
    assert np.array_equal(np.concatenate(mesh.cell_data["stress"]).ravel(), np.arange(45.0))
    assert np.array_equal(contact.points, [[0, 0, 0], [0.0125, 0, 0], [0.025, 0, 0]])
    assert contact.cells[0].type == "vertex"
    assert contact.point_data["pressure"].tolist() == [1.0, 2.0, 3.0]
    assert contact.point_data["status"].tolist() == [0, 1, 2]
    assert contact.point_data["normal"].tolist() == [[0, 1, 0]] * 3


def test_vtk_of_quadratic_cells_and_without_contact_is_one_file(tmp_path):
    points = np.concatenate([CUBE[[0, 1, 3, 4]], 0.5 * np.array([CUBE[a] + CUBE[b] for a, b in
                             ((0, 1), (1, 3), (3, 0), (0, 4), (1, 4), (3, 4))])])  # fmt: skip
    system = made([(points, {"tetra10": np.arange(10)[None]})], 3)
    (path,) = write_vtk(system, str(tmp_path / "one.VTU"), vectors={"u": np.ones(30)})
    read = meshio.read(path, file_format="vtu")
    assert read.cells[0].type == "tetra10"
    assert np.array_equal(read.cells[0].data, np.arange(10)[None])
    assert b"vtkZLibDataCompressor" in path.read_bytes()


def test_vtk_says_everything_that_does_not_fit(tmp_path):
    system = plane_system()
    with pytest.raises(CaseError) as caught:
        write_vtk(
            system,
            tmp_path / "mode.stl",
            vectors={"mode": np.zeros(3)},
            cell_data={"stress": np.zeros(7)},
            point_data={"t": np.zeros(7)},
            contact_data={"pressure": np.zeros(2)},
        )
    lines = str(caught.value).splitlines()
    assert lines[0] == "path: 'mode.stl' – not a VTK file; the name must end in .vtu or .vtk"
    assert lines[1].endswith(f"one value for each of {system.size} freedoms")
    assert "first length must be 47 or 53, the number of points (with lines)" in lines[2]
    assert "first length must be 40 or 45, the number of cells (with lines)" in lines[3]
    assert "first length must be 3, the number of contact nodes" in lines[4]
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(AnalysisError, match="cannot write"):
        write_vtk(system, tmp_path / "file" / "mode.vtu")


def test_vtk_replaces_an_old_file_only_with_a_whole_one(tmp_path, monkeypatch):
    old = tmp_path / "mode.vtu"
    old.write_text("old")

    def broken(self, path, **_):
        Path(path).write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(meshio.Mesh, "write", broken)
    with pytest.raises(AnalysisError, match="No space left on device"):
        write_vtk(plane_system(), old)
    assert old.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["mode.vtu"]


@pytest.mark.parametrize("size", [(0.12, 0.04), (0.04, 0.04), (0.02, 0.1)])
def test_titles_and_labels_of_a_contact_lie_within_the_picture(size: tuple[float, float]):
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, size[0], 9), np.linspace(0, size[1], 5)))
    position = np.column_stack([x, y, np.zeros(len(x))])
    tangents = np.tile(np.eye(3)[:2], (len(x), 1, 1))
    slip = np.tile([2.0, 0.0], (len(x), 1))
    run = history(position, tangents)
    for figure in (
        interface_energy(position, x - 0.01, tangents=tangents, slip=slip, quantity="energy per cycle", unit=""),
        contact_snapshot(NodeHistory(**{**run.__dict__, "slip_velocity": np.tile(slip, (40, 1, 1))}), 0.0),
    ):
        lay_out(figure)
        renderer = FigureCanvasAgg(figure).get_renderer()
        ax = figure.axes[0]
        for text in (ax._left_title, ax.xaxis.label, ax.yaxis.label, *ax.texts):
            box = text.get_window_extent(renderer)
            # Measured in the reader's style, which has longer ticks: two points more are no cut.
            outside = max(-box.x0, -box.y0, box.x1 - figure.bbox.width, box.y1 - figure.bbox.height)
            assert not text.get_text() or outside < 3.0, text.get_text()


def test_the_leading_edge_is_ahead_of_the_slave():
    place, along, _ = ring(np.linspace(-0.3, 0.3, 5))
    for sign in (1.0, -1.0):
        slip = np.zeros((len(place), along.shape[1]))
        slip[:, 0] = 3.0 * sign
        ax = interface_energy(place, np.ones(len(place)), tangents=along, slip=slip).axes[0]
        at = {text.get_text(): text.get_position()[0] for text in ax.texts if text.get_text()}
        assert set(at) == {"leading edge", "trailing edge"}
        # The picture has the first tangents across.
        assert (at["leading edge"] > at["trailing edge"]) == (sign > 0)
        # Material of the other body comes in there and goes out behind, the other way.
        arrows = [text for text in ax.texts if getattr(text, "arrow_patch", None) is not None]
        assert len(arrows) == 2
        assert all((arrow.xy[0] - arrow.get_position()[0]) * sign < 0 for arrow in arrows)
    position, tangents = on_line(5)
    ax = interface_energy(position, np.ones(5), tangents=tangents, slip=np.full((5, 1), -1.0)).axes[0]
    assert [text.get_text() for text in ax.texts] == ["→ leading edge", "trailing edge →"]
    # All round a ring no edge leads.
    place, along, _ = ring(np.linspace(-np.pi, np.pi, 36, endpoint=False))
    slip = np.tile([1.0, 0.0], (len(place), 1))
    assert not interface_energy(place, np.ones(len(place)), tangents=along, slip=slip).axes[0].texts


def test_a_steady_picture_has_no_time():
    position, tangents = on_line()
    figure = contact_snapshot(history(position, tangents), 0.0, title="contact pad in steady sliding")
    assert figure.axes[0].get_title(loc="left") == "contact pad in steady sliding"


def test_one_moving_corner_does_not_leave_the_rest_dark():
    system = space_system()
    skin = skin_of(system)
    even = np.ones(system.size, dtype=complex)
    assert not solid_plots.concentrated(skin_of(system, even))
    corner = np.full(system.size, 0.04, dtype=complex)
    corner[:3] = 1.0
    bent = solid_plots.mode_shape(system, corner)
    assert solid_plots.concentrated(skin_of(system, corner))
    bar = bent.axes[1]
    assert 0.05 in np.round(bar.get_yticks(), 3)
    assert len(skin.points)
    # What moves by 4 % is drawn a fifth of the way up the colours.
    norm = bent.axes[1]._colorbar.norm
    assert float(norm(0.04)) == pytest.approx(0.2)
