"""The model to scale, as SVG: bodies, supports, loads, contacts and the direction of sliding."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape

import numpy as np

from ...case import Case, PointRef
from ...case.bodies import BeamBody, MassBody
from ...errors import CaseError
from ...system import System
from ...typing import Array
from ...view.colours import COLOURS, GREEN, VERMILION
from ...view.skin import Skin, skin_of
from .mesh_marks import held_nodes, pushes, slides

WIDTH = 300.0  # units of the drawing, which the page fits into its column
MARGIN = 46.0  # around the model, for supports, arrows and words
ARROW = 30.0
MASS = 5.0  # radius of a point mass
MOST_FACETS = 4000  # of meshed bodies, beyond which only some are drawn
TALLEST = 1.0  # height over width, at most


@dataclass
class _Sheet:
    """The drawing under way: model coordinates [m] to units of the drawing, y pointing down."""

    low: Array
    high: Array
    parts: list[str] = field(default_factory=list[str])
    words: list[str] = field(default_factory=list[str])
    named: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])

    @property
    def scale(self) -> float:
        """Units for a metre."""
        span = np.maximum(self.high - self.low, 1e-12)
        return float(min((WIDTH - 2 * MARGIN) / span[0], (TALLEST * WIDTH - 2 * MARGIN) / span[1]))

    @property
    def height(self) -> float:
        """Of the sheet, in its units."""
        return float((self.high - self.low)[1]) * self.scale + 2 * MARGIN

    def at(self, point: Array) -> tuple[float, float]:
        """Where a point (2,) [m] lies on the sheet."""
        span = (self.high - self.low) * self.scale
        x = (WIDTH - span[0]) / 2 + (float(point[0]) - self.low[0]) * self.scale
        return float(x), float(self.height - MARGIN - (float(point[1]) - self.low[1]) * self.scale)

    def text(self, x: float, y: float, words: str, *, kind: str = "", anchor: str = "middle") -> None:
        """A text about a place of the sheet."""
        x, y = min(max(x, 4.0), WIDTH - 4.0), min(max(y, 10.0), self.height - 3.0)
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" class="{kind}">{escape(words)}</text>')

    def name(self, x: float, y: float, words: str) -> None:
        """A name at a place, or below those that stand there."""
        while any(abs(x - x0) < 40 and abs(y - y0) < 11 for x0, y0 in self.named):
            y += 11
        self.named.append((x, y))
        self.text(x, y, words, kind="name")

    def arrow(self, tail: tuple[float, float], tip: tuple[float, float], colour: str) -> None:
        """An arrow."""
        (x0, y0), (x1, y1) = tail, tip
        size = float(np.hypot(x1 - x0, y1 - y0)) or 1.0
        ux, uy = (x1 - x0) / size, (y1 - y0) / size
        head = f"{x1:.1f},{y1:.1f} {x1 - 8 * ux + 4 * uy:.1f},{y1 - 8 * uy - 4 * ux:.1f} " \
               f"{x1 - 8 * ux - 4 * uy:.1f},{y1 - 8 * uy + 4 * ux:.1f}"  # fmt: skip
        self.parts.append(
            f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1 - 6 * ux:.1f}" y2="{y1 - 6 * uy:.1f}" stroke="{colour}" '
            f'stroke-width="2"/><polygon points="{head}" fill="{colour}"/>'
        )


def drawing(case: Case, system: System) -> str:
    """SVG of a case as it stands, with a text alternative; "" of matrices whose freedoms have no places."""
    try:
        skin = skin_of(system)
    except CaseError:
        return ""
    seen = _seen(skin.points)
    sheet = _Sheet(seen.min(axis=0), seen.max(axis=0))
    names = list(skin.names)
    sheet.words.append(f"bodies {', '.join(names)}")
    _draw_mesh(sheet, skin, seen)
    for s in skin.lone.tolist():
        x, y = sheet.at(seen[skin.segments[s, 0]])
        colour = COLOURS[int(skin.segment_body[s]) % len(COLOURS)]
        sheet.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{MASS:g}" fill="{colour}"/>')
    middles: list[tuple[float, float, str]] = []
    for index, name in enumerate(names):
        body = case.bodies.get(name)
        if isinstance(body, BeamBody):
            _draw_beam(sheet, name, body, COLOURS[index % len(COLOURS)])
        elif skin.dimension == 2 or len(names) > 1:
            x, y = sheet.at(seen[skin.point_body == index].mean(axis=0))
            if isinstance(body, MassBody):
                y += MASS + 9
            middles.append((y, x, name))
    for y, x, name in sorted(middles):  # those above before those that make way for them
        sheet.name(x, y, name)
    _draw_supports(sheet, case)
    _draw_loads(sheet, case)
    _draw_contacts(sheet, case, system)
    _draw_on_meshes(sheet, case, system)
    _scale_bar(sheet)
    label = escape(f"The model to scale: {'; '.join(sheet.words)}.")
    return (
        f'<svg viewBox="0 0 {WIDTH:g} {sheet.height:.0f}" role="img" aria-label="{label}" '
        f'class="st-drawing" xmlns="http://www.w3.org/2000/svg">{"".join(sheet.parts)}</svg>'
    )


def _seen(points: Array) -> Array:
    """Points or vectors (k, d) as seen (k, 2): in the plane as they are, of space from the usual direction."""
    if points.shape[1] == 2:
        return points
    rise, turn = np.radians(28.0), np.radians(-58.0)
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.array([-np.sin(rise) * np.cos(turn), -np.sin(rise) * np.sin(turn), np.cos(rise)])
    return np.column_stack([points @ right, points @ up])


def _draw_mesh(sheet: _Sheet, skin: Skin, seen: Array) -> None:
    """Facets of meshed bodies, those in front over those behind."""
    if not len(skin.facets):
        return
    rise, turn = np.radians(28.0), np.radians(-58.0)
    toward = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    depth = (skin.points @ toward)[skin.facets].mean(axis=1) if skin.dimension == 3 else skin.body.astype(float)
    order = np.argsort(depth, kind="stable")
    if skin.closed and skin.dimension == 3:
        corner = seen[skin.facets]
        across, along = corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]
        order = order[(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0] > 0)[order]]
    order = order[:: max(1, len(order) // MOST_FACETS)]
    for f in order:
        points = " ".join("{:.1f},{:.1f}".format(*sheet.at(seen[k])) for k in dict.fromkeys(skin.facets[f].tolist()))
        colour = COLOURS[int(skin.body[f]) % len(COLOURS)]
        sheet.parts.append(f'<polygon points="{points}" fill="{colour}" fill-opacity="0.5" stroke="{colour}" '
                           'stroke-width="0.3"/>')  # fmt: skip


def _draw_beam(sheet: _Sheet, name: str, body: BeamBody, colour: str) -> None:
    """A beam with its true thickness, no thinner than can be seen."""
    (x0, y0), (x1, y1) = sheet.at(np.array(body.start)), sheet.at(np.array(body.end_point))
    wide = max(2.5, body.thickness * sheet.scale)
    sheet.parts.append(f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{colour}" '
                       f'stroke-width="{wide:.1f}"/>')  # fmt: skip
    ux, uy = body.direction
    upright = abs(uy) > abs(ux)
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    if upright:
        sheet.text(x - 10, y, name, kind="name", anchor="end")
    else:
        sheet.text(x0 + 0.45 * (x1 - x0), y + wide / 2 + 12, name, kind="name")


def _draw_supports(sheet: _Sheet, case: Case) -> None:
    for name, support in case.supports.items():
        place = _place(case, support.at)
        held = ", ".join({"rotation": "φ"}.get(d, d) for d in support.fixed)
        speed = np.array([support.velocity.get("x", 0.0), support.velocity.get("y", 0.0)])
        size = float(np.hypot(*speed))
        moves = f", moves with {size:g} m/s" if size else ""
        sheet.words.append(f"support {name} at {support.at} holds {held}{moves}")
        if place is None:
            continue
        x, y = sheet.at(place)
        sheet.parts.append(f'<rect x="{x - 5:.1f}" y="{y - 5:.1f}" width="10" height="10" class="support"/>')
        if x < WIDTH / 3:  # where the middle is full of the model
            sheet.text(x - 8, y + 24, f"holds {held}", anchor="start")
        else:
            sheet.text(x + 9, y + 4, f"holds {held}", anchor="start")
        if size:
            ux, uy = speed[0] / size, -speed[1] / size
            tail = (x + 2, y - 14) if ux >= 0 else (x + 2 + ARROW, y - 14)
            sheet.arrow(tail, (tail[0] + ARROW * ux, tail[1] + ARROW * uy), GREEN)
            sheet.text(x - 8, y - 22, f"{size:g} m/s", kind="speed", anchor="start")


def _draw_loads(sheet: _Sheet, case: Case) -> None:
    for name, load in case.loads.items():
        force = np.array([*load.force, 0.0][:2])
        size = float(np.linalg.norm(load.force))
        if load.pressure:
            sheet.words.append(f"load {name}: {load.pressure:g} Pa on {load.at}")
        if not size or load.at is None:
            continue
        sheet.words.append(f"load {name}: {size:g} N at {load.at}")
        place = _place(case, load.at)
        flat = float(np.hypot(*force))
        if place is None or not flat:
            continue
        x, y = sheet.at(place)
        ux, uy = force[0] / flat, -force[1] / flat
        tip = (x - 7 * ux, y - 7 * uy)
        sheet.arrow((tip[0] - ARROW * ux, tip[1] - ARROW * uy), tip, VERMILION)
        sheet.text(tip[0] - 0.6 * ARROW * ux + 7, tip[1] - 0.6 * ARROW * uy, f"{size:g} N", kind="load", anchor="start")


def _draw_contacts(sheet: _Sheet, case: Case, system: System) -> None:
    for contact in system.contacts:
        x, y = sheet.at(contact.slave_position)
        sheet.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" class="contact"/>')
        sheet.text(x + 10, y - 6, contact.name, kind="name", anchor="start")
    for name, contact in case.contacts.items():
        sheet.words.append(f"contact {name}: {contact.slave} on {contact.master}")


def _draw_on_meshes(sheet: _Sheet, case: Case, system: System) -> None:
    """Held nodes, loads that are not drawn at their point, and which way contacts slide."""
    if not system.solids:
        return
    for node in _seen(held_nodes(system)):
        x, y = sheet.at(node)
        sheet.parts.append(f'<rect x="{x - 1.5:.1f}" y="{y - 1.5:.1f}" width="3" height="3" class="support"/>')
    for push in pushes(system):
        load = case.loads.get(push.name)
        ahead = _seen(push.direction[None])[0]
        if load is None or (load.at is not None and _place(case, load.at) is not None) or not _across(ahead):
            continue
        tip, (ux, uy) = sheet.at(_seen(push.at[None])[0]), _unit(ahead)
        size = float(np.linalg.norm(load.force))
        words = f"{load.pressure:g} Pa" if load.pressure else f"{size:g} N" if size else push.name
        sheet.arrow((tip[0] - ARROW * ux, tip[1] + ARROW * uy), tip, VERMILION)
        sheet.text(tip[0] - ARROW * ux + 6, tip[1] + ARROW * uy, words, kind="load", anchor="start")
    for slide in slides(system):
        if not _across(_seen(slide.direction[None])[0]):
            continue
        (x, y), (ux, uy) = sheet.at(_seen(slide.at[None])[0]), _unit(_seen(slide.direction[None])[0])
        tip = (x + 1.2 * ARROW * ux, y - 1.2 * ARROW * uy)
        sheet.arrow((x + 0.2 * ARROW * ux, y - 0.2 * ARROW * uy), tip, GREEN)
        sheet.text(max(x, tip[0]), min(y, tip[1]) - 7, slide.words, kind="speed", anchor="end")
        sheet.words.append(f"contact {slide.name} slides with {slide.words}")


def _across(direction: Array) -> bool:
    """Whether a direction as seen is one on the sheet, not towards whoever looks."""
    return float(np.linalg.norm(direction)) > 0.05


def _unit(vector: Array) -> tuple[float, float]:
    size = float(np.linalg.norm(vector)) or 1.0
    return float(vector[0]) / size, float(vector[1]) / size


def _scale_bar(sheet: _Sheet) -> None:
    """A length to compare with."""
    span = 0.3 * WIDTH / sheet.scale
    power = 10.0 ** np.floor(np.log10(span))
    length = float(max(m * power for m in (1, 2, 5) if m * power <= span))
    y = sheet.height - 8
    x1 = WIDTH - 10
    x0 = x1 - length * sheet.scale
    path = f"M{x0:.1f} {y - 3:.1f}v6M{x0:.1f} {y:.1f}H{x1:.1f}M{x1:.1f} {y - 3:.1f}v6"
    sheet.parts.append(f'<path d="{path}" class="bar"/>')
    words = f"{1e3 * length:g} mm" if length < 1 else f"{length:g} m"
    sheet.text((x0 + x1) / 2, y - 5, words)


def _place(case: Case, reference: str) -> Array | None:
    """Coordinates (2,) [m] of a point in the plane; None of a boundary, and in space."""
    point = case.location(reference)
    if not isinstance(point, PointRef) or case.dimension != 2:
        return None
    body = case.bodies[point.body]
    found = body.coordinates(point.distance) if isinstance(body, BeamBody) else point.coordinates
    return None if found is None else np.array(found)
