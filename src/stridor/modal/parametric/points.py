"""Modes of a reduced model at many points of its box, as one result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from ...notebook import Shown, counted, html_table
from ...tabular import MODE, Rows, Tabular, dataset, mode_cells
from ...typing import Array, BoolArray, IntArray
from .correct import CorrectedModes, Corrector
from .model import ReducedModel, ReducedModes
from .problem import NOT_KNOWN

NAMED = 3  # points, at most
OF_MODES = ("frequency_hz", "growth_rate", "unstable", "error", "passed", "residual")


@dataclass(frozen=True, repr=False)
class ModesAtPoints(Tabular, Shown):
    """Modes at points (p,): parameters, their names, and values (p, n) there. frequency_hz [Hz], growth_rate [1/s],
    error (relative, estimated) and residual (p, m), NaN where a point has fewer modes than others; unstable, passed
    (error below the model's bound) (p, m). inside (p,): whether in the model's box; corrections (p,): steps taken.
    unlike: of each point why the model does not hold there, in words, as where others touch than the nodes that it
    holds, or that this is not known; "" where it holds, and none of it where nobody looked."""

    parameters: tuple[str, ...]
    values: Array
    frequency_hz: Array
    growth_rate: Array
    unstable: BoolArray
    error: Array
    passed: BoolArray
    residual: Array
    inside: BoolArray
    corrections: IntArray
    provenance: dict[str, Any] = field(default_factory=dict)
    unlike: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        model: ReducedModel,
        at: Mapping[str, Sequence[float]],
        *,
        corrections: int = 0,
        solver: str | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> ModesAtPoints:
        """The modes at all combinations of values, of the model's own where a parameter is not named; corrected in the
        full problem by up to so many steps where they do not pass."""
        names = tuple(p.name for p in model.problem.parameters)
        combinations = list(product(*(at.get(p.name, [p.value]) for p in model.problem.parameters)))
        found: list[ReducedModes | CorrectedModes] = []
        corrector: Corrector | None = None
        try:
            for combination in combinations:
                modes: ReducedModes | CorrectedModes = model.modes(dict(zip(names, combination, strict=True)))
                if corrections and not modes.passed.all():
                    corrector = corrector or Corrector(model, solver=solver)
                    modes = corrector.modes(modes.point, steps=corrections)
                found.append(modes)
        finally:
            if corrector is not None:
                corrector.free()
        shape = len(found), max((len(modes.values) for modes in found), default=0)
        numbers: dict[str, Any] = {name: np.full(shape, np.nan) for name in OF_MODES}
        for k, modes in enumerate(found):
            own = {"residual": modes.scaled_residual} if isinstance(modes, CorrectedModes) else {}
            for name, values in numbers.items():
                values[k, : len(modes.values)] = own.get(name, getattr(modes, name))
        flags: dict[str, Any] = {name: np.nan_to_num(numbers.pop(name)) > 0 for name in ("unstable", "passed")}
        return cls(
            parameters=names,
            values=np.array(combinations, dtype=float).reshape(len(found), len(names)),
            **numbers,
            **flags,
            inside=np.array([bool(modes.inside) for modes in found], dtype=bool),
            corrections=np.array([m.steps if isinstance(m, CorrectedModes) else 0 for m in found], dtype=np.int64),
            provenance=dict(provenance or {}),
            unlike=model.unlike([modes.point for modes in found]),
        )

    def __len__(self) -> int:
        return len(self.values)

    def unlike_words(self) -> tuple[str, ...]:
        """A sentence on the points at which the model does not hold; () for none."""
        return unlike_words(self.parameters, self.values.tolist(), self.unlike)

    def counts(self) -> list[int]:
        """How many modes each point has."""
        return np.isfinite(self.frequency_hz).sum(axis=1).tolist()

    def to_json(self) -> list[dict[str, Any]]:
        """A document for each point, as `stridor reduce --json` prints them."""
        return [
            {
                "point": dict(zip(self.parameters, self.values[k].tolist(), strict=True)),
                "inside": bool(self.inside[k]),
                **({"unlike": self.unlike[k]} if self.unlike and self.unlike[k] else {}),
                "corrections": int(self.corrections[k]),
                **{name: getattr(self, name)[k, :count].tolist() for name in OF_MODES},
            }
            for k, count in enumerate(self.counts())
        ]

    def table(self) -> Rows:
        """Heads and rows, as reduced.csv has them: one for each mode of each point, columns of the parameters first; a
        column ``unlike`` where others touch at some of them."""
        more = ("unlike",) if any(self.unlike) else ()
        heads = (*self.parameters, *MODE, "error", "residual", "inside", "corrections", *more)
        return heads, [
            (
                *self.values[k].tolist(),
                *mode_cells(
                    float(self.frequency_hz[k, m]), float(self.growth_rate[k, m]), unstable=bool(self.unstable[k, m])
                ),
                float(self.error[k, m]), float(self.residual[k, m]), bool(self.inside[k]), int(self.corrections[k]),
                *((self.unlike[k],) if more else ()),
            )
            for k, count in enumerate(self.counts())
            for m in range(count)
        ]  # fmt: skip

    @property
    def _line(self) -> str:
        some = int(np.any(self.unstable, axis=1).sum())
        return f"modes at {counted(len(self), 'point')}, unstable ones at {some or 'none'}"

    def _repr_html_(self) -> str:
        heads, rows = self.table()
        shown = [[f"{cell:.6g}" if isinstance(cell, float) else str(cell) for cell in row] for row in rows]
        return html_table(f"Reduced {self._line}", heads, shown)

    def to_xarray(self) -> Any:
        """xarray.Dataset with dimensions point, mode and number (the parameters), as `st.save` writes it."""
        variables: dict[str, Any] = {
            "value": (("point", "number"), self.values),
            "frequency_hz": (("point", "mode"), self.frequency_hz, {"units": "Hz"}),
            "growth_rate": (("point", "mode"), self.growth_rate, {"units": "1/s"}),
            "error": (("point", "mode"), self.error, {"long_name": "estimated relative error of the eigenvalue"}),
            "residual": (("point", "mode"), self.residual),
            **{name: (("point", "mode"), getattr(self, name).astype(np.int8)) for name in ("unstable", "passed")},
            "inside": (("point",), self.inside.astype(np.int8)),
            "corrections": (("point",), self.corrections),
        }
        names = {"number": ("number", np.array(self.parameters, dtype=object))}
        if any(self.unlike):
            variables["unlike"] = (("point",), np.array(self.unlike, dtype=object))
        return dataset("reduced modes", variables, names, self.provenance)


def unlike_words(names: Sequence[str], values: Sequence[Sequence[float]], unlike: Sequence[str]) -> tuple[str, ...]:
    """A sentence on those of some points (p, n) at which a model does not hold, as ``unlike`` (p,) says of each; ()
    where it says so of none."""
    told = [
        f"{', '.join(f'{name} = {value:.4g}' for name, value in zip(names, at, strict=True))} ({words})"
        for at, words in zip(values, unlike, strict=False)
        if words
    ]
    if not told:
        return ()
    rest = f" and {len(told) - NAMED} more" if len(told) > NAMED else ""
    known = any(words and words != NOT_KNOWN for words in unlike)
    have = "`stridor modes` has those there" if known else "given the case file in place of the model it is looked at"
    return (f"Modes of the model {'do' if known else 'may'} not hold at {'; '.join(told[:NAMED])}{rest}: {have}.",)
