"""Which numbers of a case are moved on the page, and how far: the same dotted paths as `--set`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from ...case import Case
from ...case.overrides import number_at
from ...errors import CaseError

MOST = 60  # levers
STEPS = 200  # of a slider, from one end to the other


@dataclass(frozen=True)
class Lever:
    """A number that is moved: its path, what it is called, its unit, where it stands and how far it goes.

    scale "log": by equal factors, for what spans decades. group: under which heading it stands.
    """

    path: str
    label: str
    unit: str
    value: float
    low: float
    high: float
    group: str
    scale: Literal["linear", "log"] = "linear"

    @property
    def words(self) -> str:
        """Its name with its unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


def levers(case: Case) -> list[Lever]:
    """What can be moved in a case, the usual levers against squeal first. The range is about the case as it was given,
    so that it stays where it is while one moves."""
    data = case.model_dump(mode="json", exclude_none=True)
    found: dict[str, Lever] = {}
    for path, label, unit, group in _candidates(case):
        if path in found or len(found) >= MOST:
            continue
        try:
            value = number_at(data, path)
        except CaseError:
            continue
        if (lever := _lever(path, label, unit, value, group, case)) is not None:
            found[path] = lever
    return list(found.values())


def friction_range(case: Case) -> tuple[float, float]:
    """Over which μ the page draws: that in which onsets are sought."""
    low, high = case.modal.friction_range
    return float(low), float(high)


def _candidates(case: Case) -> Iterator[tuple[str, str, str, str]]:
    """Path, label, unit and group of all that may be a lever."""
    for name in case.parameters:
        if name != "mu":
            yield f"parameters.{name}.value", name, "", "Parameters"
    for name, contact in case.contacts.items():
        slave = contact.slave.replace("@", ".").partition(".")[0]
        yield f"bodies.{slave}.angle_deg", f"{slave} angle", "°", "Contact"
        for axis, letter in enumerate("xy"):
            if slave in case.beams:
                yield f"bodies.{slave}.start.{axis}", f"{slave} position {letter}", "m", "Contact"
        area = "N/m³" if "." in contact.master else "N/m"
        yield f"contacts.{name}.stiffness", f"{name} stiffness", area, "Contact"
    for name, load in case.loads.items():
        for axis, letter in enumerate("xyz"[: len(load.force)]):
            yield f"loads.{name}.force.{axis}", f"{name} force {letter}", "N", "Load and speed"
        yield f"loads.{name}.pressure", f"{name} pressure", "Pa", "Load and speed"
    for name, support in case.supports.items():
        for direction in support.velocity:
            unit = "rad/s" if direction == "rotation" else "m/s"
            yield f"supports.{name}.velocity.{direction}", f"{name} speed {direction}", unit, "Load and speed"
    for name, body in case.bodies.items():
        sliding: Any = getattr(body, "sliding", None)
        if sliding is not None:
            yield f"bodies.{name}.sliding.spin", f"{name} turning", "rad/s", "Load and speed"
    yield from _of_bodies(case)


def _of_bodies(case: Case) -> Iterator[tuple[str, str, str, str]]:
    for name in case.bodies:
        yield f"bodies.{name}.damping.mass", f"{name} damping α₁", "1/s", "Damping"
        yield f"bodies.{name}.damping.stiffness", f"{name} damping α₂", "s", "Damping"
    for name in case.dashpots:
        yield f"dashpots.{name}.damping", f"{name} damping", "N s/m", "Damping"
    for name in case.springs:
        yield f"springs.{name}.stiffness", f"{name} stiffness", "N/m", "Springs"
        yield f"springs.{name}.damping", f"{name} damping", "N s/m", "Damping"
    for name in case.beams:
        yield f"bodies.{name}.thickness", f"{name} thickness", "m", "Bodies"
        yield f"bodies.{name}.width", f"{name} width", "m", "Bodies"
    for name in case.materials:
        yield f"materials.{name}.young_modulus", f"{name} Young's modulus", "Pa", "Materials"
        yield f"materials.{name}.density", f"{name} density", "kg/m³", "Materials"


_DECADES = ("stiffness", "damping.mass", "damping.stiffness", "damping", "pressure")  # ends of paths


def _lever(path: str, label: str, unit: str, value: float, group: str, case: Case) -> Lever | None:
    """A lever about a value; None where it has no size to move by."""
    head, _, rest = path.partition(".")
    if head == "parameters":
        given = case.parameters[rest.partition(".")[0]].range
        low, high = given or _about(value)
        return Lever(path, label, unit, value, low, high, group)
    if path.endswith("angle_deg"):
        return Lever(path, label, unit, value, value - 30.0, value + 30.0, group)
    if ".start." in path:
        master = _reach(case, path)
        return None if master is None else Lever(path, label, unit, value, *master, group)
    if value == 0.0:
        return None
    if head != "materials" and path.endswith(_DECADES):
        return Lever(path, label, unit, value, value / 1e3, value * 1e3, group, "log") if value > 0 else None
    return Lever(path, label, unit, value, *_about(value), group)


def _about(value: float) -> tuple[float, float]:
    """A range around a number, from a fifth to three times as much, of its own sign; ± 1 about nothing."""
    ends = (0.2 * value, 3.0 * value)
    return (-1.0, 1.0) if value == 0 else (min(ends), max(ends))


def _reach(case: Case, path: str) -> tuple[float, float] | None:
    """How far a slave beam can be moved along the beams that it slides on, in one direction; None across them."""
    _, name, _, axis = path.split(".")
    k = int(axis)
    masters = [case.beams.get(c.master) for c in case.contacts.values() if c.slave.startswith((f"{name}.", f"{name}@"))]
    if not masters or any(beam is None or abs(beam.direction[k]) < 1.0 - 1e-9 for beam in masters):
        return None
    ends = [sorted((beam.start[k], beam.end_point[k])) for beam in masters if beam is not None]
    low, high = max(e[0] for e in ends), min(e[1] for e in ends)
    margin = 0.02 * (high - low)
    return (low + margin, high - margin) if high > low else None
