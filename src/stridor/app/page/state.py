"""What a page shows, as one frozen value: the case, what was changed in it, and what is chosen.

Every control makes another `PageState`; undo and redo walk along those before and after, and a link holds one.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import math
import tomllib
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from ...case import Case, loads, template_text, templates
from ...case.outsized import deep_line
from ...case.overrides import apply, split_path
from ...errors import CaseError
from ...laws.friction import is_zero

LARGEST_TEXT = 5_000_000  # bytes of a case that is uploaded or comes in a link
LARGEST_LINK = 60_000  # letters: what browsers and mail programs take
MOST_CHANGES = 200
DEPTH = 200  # states kept for undo
TABS = ("bench", "map")


@dataclass(frozen=True)
class Source:
    """Where the text of a case comes from: its name, the text, and the folder that files in it are sought in.

    folder None: nobody at this computer has vouched for the text, so it may name no files.
    """

    name: str
    text: str
    folder: str | None = None

    @property
    def key(self) -> str:
        """What links call it where the server has it: a name that another text does not have."""
        told = "\n".join((self.folder or "", self.text)).encode()
        return f"file:{hashlib.sha256(told).hexdigest()[:16]}"

    @staticmethod
    def template(name: str) -> Source:
        """A template that comes with stridor. Raises CaseError for a name that is none."""
        return Source(name, template_text(name))


@dataclass(frozen=True)
class PageState:
    """A case by its source, numbers changed in it by their dotted paths, and what is looked at.

    mu: the friction coefficient of every contact; branch: the mode chosen, by its number, or None.
    """

    source: Source
    changes: Mapping[str, float] = field(default_factory=dict[str, float])
    mu: float = 0.0
    branch: int | None = None
    tab: str = "bench"

    def case(self) -> Case:
        """The case with its changes. Raises CaseError, as `load` does."""
        case = checked(self.source)
        return case.with_(dict(self.changes)) if self.changes else case

    def with_change(self, path: str, value: float) -> PageState:
        """With another number at a path; what the case has itself is no change."""
        changes = {k: v for k, v in self.changes.items() if k != path}
        return replace(self, changes={**changes, path: float(value)})

    @property
    def model(self) -> tuple[Source, tuple[tuple[str, float], ...]]:
        """What the matrices follow from: all but μ and what is looked at."""
        return self.source, tuple(sorted(self.changes.items()))

    @property
    def stamp(self) -> str:
        """Of what model an answer is, where it has to be told from one that came late."""
        return hashlib.sha256(repr(self.model).encode()).hexdigest()[:16]


@lru_cache(16)
def checked(source: Source) -> Case:
    """The case of a source as it was given. Raises CaseError with the words of the command line, and for files named by
    a text that nobody at this computer has opened."""
    if len(source.text) > LARGEST_TEXT:
        raise CaseError(source.name, None, f"a case file of at most {LARGEST_TEXT / 1e6:g} MB")
    if source.folder is not None:
        return loads(source.text, source=source.name, folder=Path(source.folder))
    if files := _files_named(source.text):
        raise CaseError(
            files[0], None,
            "names a file of this computer, which a page does not read for a case that it was sent: open it with "
            "stridor app CASE.toml",
        )  # fmt: skip
    return loads(source.text, source=source.name)


def _files_named(text: str) -> list[str]:
    """Dotted paths of the files that a text names; none of a text that is no TOML or that reading would take for ever,
    which `loads` says itself."""
    if deep_line(text):
        return []
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError):
        return []
    found: list[str] = []
    tables: list[tuple[str, Any]] = [(k, data[k]) for k in ("bodies", "matrices") if k in data]
    while tables:
        where, node = tables.pop()
        if isinstance(node, dict):
            items = cast("dict[str, Any]", node).items()
            found += [f"{where}.{k}" for k, v in items if k in ("file", "labels", "mesh") and isinstance(v, str)]
            tables += [(f"{where}.{k}", v) for k, v in items]
        elif isinstance(node, list):
            tables += [(f"{where}.{k}", v) for k, v in enumerate(cast("list[Any]", node))]
    return found


def first_state(source: Source) -> PageState:
    """A source as it is, at the friction of the case (`own_friction`). Raises CaseError."""
    return PageState(source, mu=own_friction(checked(source)))


def own_friction(case: Case) -> float:
    """The friction coefficient of a case as it was written: that of its contacts, the largest where they differ."""
    if "mu" in case.parameters:
        return case.parameters["mu"].value
    return max((c.friction.coefficient for c in case.contacts.values()), default=0.0)


def different_frictions(case: Case) -> dict[str, float]:
    """The friction coefficients of contacts that do not have the same one; none where one is meant for all."""
    own = {name: c.friction.coefficient for name, c in case.contacts.items() if name not in frictionless(case)}
    return own if len(set(own.values())) > 1 and "mu" not in case.parameters else {}


def frictionless(case: Case) -> set[str]:
    """Contacts without friction at any μ, where others have some."""
    zero = {name for name, contact in case.contacts.items() if is_zero(contact.friction.law_object())}
    return zero if len(zero) < len(case.contacts) else set()


class History:
    """The states of a page: the present one, those before and those that were taken back."""

    def __init__(self, first: PageState) -> None:
        self.now = first
        self._before: list[PageState] = []
        self._after: list[PageState] = []

    def go(self, state: PageState, *, together: bool = False) -> None:
        """To another state. together: one step for undo with the state before, as for a slider that is being moved."""
        if state == self.now:
            return
        if not together:
            self._before = [*self._before[-DEPTH + 1 :], self.now]
        self._after = []
        self.now = state

    def undo(self) -> bool:
        """Back by one; whether there was one."""
        if not self._before:
            return False
        self._after.append(self.now)
        self.now = self._before.pop()
        return True

    def redo(self) -> bool:
        """Forth again; whether there was one."""
        if not self._after:
            return False
        self._before.append(self.now)
        self.now = self._after.pop()
        return True

    @property
    def can_undo(self) -> bool:
        """Whether there is a state before."""
        return bool(self._before)

    @property
    def can_redo(self) -> bool:
        """Whether a state was taken back."""
        return bool(self._after)


def to_link(state: PageState, own: Mapping[str, Source]) -> str:
    """The state as letters for an address, "" where that gets too long. own: sources that the server has by itself
    (`key`), of which the link holds no more than the key."""
    held = next((key for key, source in own.items() if source == state.source), None)
    source = {"of": held} if held is not None else {"name": state.source.name, "text": state.source.text}
    document = {
        "v": 1, **source, "changes": dict(state.changes), "mu": state.mu, "branch": state.branch, "tab": state.tab
    }  # fmt: skip
    packed = zlib.compress(json.dumps(document, allow_nan=False).encode(), 9)
    text = base64.urlsafe_b64encode(packed).decode("ascii").rstrip("=")
    return text if len(text) <= LARGEST_LINK else ""


def from_link(text: str, own: Mapping[str, Source]) -> PageState:
    """The state that a link holds, read as data. Raises CaseError where it holds none."""
    try:
        if len(text) > LARGEST_LINK:
            raise ValueError("too long")
        packed = base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
        unpacking = zlib.decompressobj()
        plain = unpacking.decompress(packed, LARGEST_TEXT + 100_000)
        if unpacking.unconsumed_tail:
            raise ValueError("too large")
        document = json.loads(plain)
        return _state_of(document, own)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, binascii.Error, zlib.error):
        raise CaseError("link", None, "holds no state of this page; copy it again, whole") from None


def _state_of(document: Any, own: Mapping[str, Source]) -> PageState:
    if "of" in document:
        source = own[str(document["of"])]
    else:
        source = Source(str(document["name"])[:200], str(document["text"]))
    changes = {str(k): _number(v) for k, v in document["changes"].items()}
    if len(changes) > MOST_CHANGES:
        raise ValueError("too many changes")
    branch, tab, mu = document["branch"], document["tab"], _number(document["mu"])
    if tab not in TABS or mu < 0 or not (branch is None or isinstance(branch, int)):
        raise ValueError("no such state")
    return PageState(source, changes, mu, branch, tab)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError("not a number")
    return float(value)


def template_sources() -> dict[str, Source]:
    """The templates by the key that links have for them."""
    return {f"template:{name}": Source.template(name) for name in templates()}


def file_text(state: PageState) -> str:
    """The case file with its changes in it: the comments of the original stay. Raises CaseError."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    changes: dict[str, float] = {**state.changes, **friction_changes(state)}
    wanted = state.case().with_(friction_changes(state))
    if not changes:
        return state.source.text
    try:
        document = tomlkit.parse(state.source.text)
        problems = [p for path, value in changes.items() for p in apply(cast("Any", document), split_path(path), value)]
        text = tomlkit.dumps(document)  # pyright: ignore[reportUnknownMemberType]
        if not problems and loads(text, folder=Path(state.source.folder or ".")).text == wanted.text:
            return text
    except (TOMLKitError, CaseError, TypeError, ValueError):
        pass
    return wanted.text  # without the comments, but it is this case


def friction_changes(state: PageState) -> dict[str, float]:
    """What the μ of the page changes in the case: every contact's law scaled, as all analyses do with a μ."""
    case = state.case()
    if not different_frictions(case) and math.isclose(state.mu, own_friction(case), rel_tol=1e-12):
        return {}
    if "mu" in case.parameters:
        return {"parameters.mu.value": state.mu}
    changes: dict[str, float] = {}
    without = frictionless(case)
    for name, contact in case.contacts.items():
        if name in without:
            continue
        law, at = asdict_of(contact.friction), f"contacts.{name}.friction"
        scale = state.mu / contact.friction.coefficient if contact.friction.coefficient else 1.0
        if "coefficient" in law:
            changes[f"{at}.coefficient"] = state.mu
        for k, value in enumerate(law.get("coefficients", ())):
            changes[f"{at}.coefficients.{k}"] = value * scale
        if law.get("static_coefficient") is not None:
            changes[f"{at}.static_coefficient"] = law["static_coefficient"] * scale
    return changes


def asdict_of(table: Any) -> dict[str, Any]:
    """What was given of a table of the case, as plain values."""
    return asdict(table) if not hasattr(table, "model_dump") else table.model_dump(mode="json", exclude_unset=True)
