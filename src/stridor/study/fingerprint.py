"""What a run was computed with, so that going on from it with something else is noticed.

The case with its defaults written out, the friction coefficient asked for, and hashes of the files that the case names:
all of it input, so that it is the same on every machine.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..case import Case
from ..errors import CaseError, Problem
from ..reading import irregular
from ..temporal.changes import Difference, as_given
from ..temporal.trajectory import Trajectory

# Nothing of these reaches the time loop.
ELSEWHERE = ("title", "modal", "comparison", "reference")
IN_TIME = ("temporal", "phases")
RECORDING = ("temporal.record_every", "temporal.watch")
PHASE = "phases"
_FILE = re.compile(r"^bodies\..*\.?(file|labels|mesh)$")
# On the line of its keyword or on the next; what is no such line costs a look at a file.
_INPUT = re.compile(rb"\bINPUT\s*=\s*\"?([^,\"\r\n]+)", re.IGNORECASE)
_LONGEST = 1 << 12  # bytes of a name, which may lie across two blocks
_LINES = 12


def fingerprint(case: Case, mu: float | None) -> dict[str, Any]:
    """What the time loop is given: values by their path, and the SHA-256 of each file with what it includes."""
    values = {
        path: value
        for path, value in _flat(case.model_dump(mode="json", exclude_none=True), ())
        if path.split(".")[0] not in ELSEWHERE
    }
    named = {path: value for path, value in values.items() if _FILE.match(path) and isinstance(value, str)}
    files = {path: contents(Path(value)) for path, value in named.items()}
    return {"values": {k: v for k, v in values.items() if k not in files}, "mu": mu, "files": files}


def same_model(case: Case, before: Mapping[str, Any]) -> bool:
    """Whether a fingerprint is that of the same bodies, contacts, loads and motions, and of files with the same
    contents, whatever phases and time steps are."""
    try:
        now = json.loads(json.dumps(fingerprint(case, None)))
        changed = _changed(case, now["values"], before["values"])
        return not any(path.split(".")[0] not in IN_TIME for path in changed) and now["files"] == before["files"]
    except (KeyError, TypeError, AttributeError):
        return False


def _changed(case: Case, now: Mapping[str, Any], then: Mapping[str, Any]) -> list[str]:
    """Paths of the values that are others than before."""
    given = {path for path, _ in _flat(case.model_dump(mode="json", exclude_unset=True, exclude_none=True), ())}

    def learned(path: str) -> bool:
        """A number that the program has learned since stands at its default."""
        return path not in then and path not in given and _known(path, then)

    return [path for path in dict.fromkeys([*now, *then]) if now.get(path) != then.get(path) and not learned(path)]


def differences(case: Case, mu: float | None, before: Trajectory) -> tuple[list[Difference], list[Difference]]:
    """What differs from the run before: what must not without ``changed``, and what may.

    May: what is recorded, and how long phases last that are not over. Raises CaseError where the run before has no
    fingerprint that can be read.
    """
    then, now = _readable(before), fingerprint(case, mu)
    found = [
        Difference(path, then["values"].get(path), now["values"].get(path))
        for path in _changed(case, now["values"], then["values"])
    ]
    if then["mu"] != mu:
        found.append(Difference("mu", then["mu"], mu))
    for path in dict.fromkeys([*now["files"], *then["files"]]):
        was, now_is = then["files"].get(path), now["files"].get(path)
        if was != now_is:
            found.append(Difference(f"{path} (contents of the file)", _short(was), _short(now_is)))
    over = _over(before, then)
    _check_open_phase(case, before, over)
    open_phases = {f"{PHASE}.{k}.duration" for k in range(over, len(case.phases))}
    may = [d for d in found if d.path in open_phases or d.path.startswith(RECORDING)]
    return [d for d in found if d not in may], may


def check_restart(case: Case, mu: float | None, before: Trajectory, *, changed: bool) -> dict[str, Any]:
    """The record of this restart for the result; ``changed`` allows what differs, which is then in it.

    Raises CaseError for each thing that differs and must not, and for a phase that would end before it has got to.
    """
    known = "fingerprint" in before.provenance
    if not known and not changed:
        raise CaseError(
            "restart",
            "no fingerprint",
            "the file of a run that tells its model: this one was written by an older stridor or without a case, and "
            "whether it is the same model cannot be seen; --changed (changed=True) goes on from it all the same",
        )
    must, may = differences(case, mu, before) if known else ([], [])
    if must and not changed:
        raise CaseError.many(_refused(must))
    return {
        "step": before.steps,
        "time": before.steps * before.step,
        "changed": [d.to_json() for d in must],
        "settings": [d.to_json() for d in may],
        "known": known,
        "versions": before.provenance.get("versions", {}),
    }


def _refused(found: Sequence[Difference]) -> Iterator[Problem]:
    """A line each, and what to do."""
    for number, difference in enumerate(found[:_LINES]):
        accepted = f"was {as_given(difference.before)} in the run that is gone on from"
        if number == min(len(found), _LINES) - 1:
            more = f" ({len(found) - _LINES} more differ)" if len(found) > _LINES else ""
            accepted += (
                f"{more}; a restart takes the model as it was (durations of phases not yet over and what is recorded "
                "may change); --changed (changed=True) goes on with what differs and records it"
            )
        yield Problem(f"restart: {difference.path}", _Verbatim(as_given(difference.after)), accepted)


class _Verbatim(str):
    """A text that is shown as it is."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def _readable(before: Trajectory) -> Mapping[str, Any]:
    then = before.provenance.get("fingerprint")
    if (
        isinstance(then, Mapping)
        and "mu" in then
        and all(isinstance(then.get(name), Mapping) for name in ("values", "files"))
    ):
        return then
    raise CaseError("restart", "fingerprint", "damaged; start the run anew")


def _over(before: Trajectory, then: Mapping[str, Any]) -> int:
    """How many phases are over. The last one planned never is: it may be made longer, and goes on where it stopped."""
    durations: list[float] = []
    while (duration := then["values"].get(f"{PHASE}.{len(durations)}.duration")) is not None:
        durations.append(float(duration))
    ends = np.round(np.cumsum(durations[:-1]) / before.step)
    return int(np.count_nonzero(ends <= before.steps))


def _check_open_phase(case: Case, before: Trajectory, over: int) -> None:
    """Raise CaseError where the phase that the run stopped in would now end before that, or right there."""
    end = sum(p.duration for p in case.phases[: over + 1])
    done = before.steps
    least = done if done == before.planned_steps else done + 1
    if over < len(case.phases) and round(end / before.step) < least:
        raise CaseError(
            f"restart: {PHASE}.{over}.duration",
            case.phases[over].duration,
            f"the run that is gone on from has come to t = {done * before.step:.6g} s, beyond its end; make it longer",
        )


def _known(path: str, values: Mapping[str, Any]) -> bool:
    """Whether the table that a value belongs to was there."""
    table = path.rpartition(".")[0]
    return not table or any(name.startswith(f"{table}.") for name in values) or "." not in table


def _flat(value: Any, path: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    """Values of nested tables and lists of tables by dotted path; lists of plain values as they are."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, (*path, str(key)))
    elif isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value):
        for number, item in enumerate(value):
            yield from _flat(item, (*path, str(number)))
    else:
        yield ".".join(path), list(value) if isinstance(value, tuple) else value


def contents(file: Path, above: tuple[Path, ...] = ()) -> str | None:
    """SHA-256 of a file and of what an Abaqus deck includes, whatever that is called; None where it cannot be read."""
    digest = hashlib.sha256()
    included: list[Path] = []
    try:
        if irregular(file) is not None:
            return None  # said by whoever reads it
        with file.open("rb") as stream:
            deck = bool(above) or file.suffix.lower() == ".inp"
            before = b""
            for block in iter(lambda: stream.read(1 << 24), b""):
                digest.update(block)
                if deck:
                    names = (found.decode("utf-8", "replace").strip() for found in _INPUT.findall(before + block))
                    included += [file.parent / name for name in names]
                    before = block[-_LONGEST:]
    except (OSError, ValueError):
        return None
    for other in dict.fromkeys(included):
        if other not in (file, *above):
            digest.update((contents(other, (file, *above)) or "").encode())
    return digest.hexdigest()


def _short(digest: Any) -> Any:
    return f"SHA-256 {digest[:12]}…" if isinstance(digest, str) else digest


