"""What the verbs have in common: their arguments, and how a case is read."""

from __future__ import annotations

import inspect
import json
import logging
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Concatenate, ParamSpec

import typer

from .. import heap, interrupts
from ..errors import AnalysisError, CaseError, StridorError
from .heartbeat import beating
from .option_table import TABLE, Json, Out, Quiet, Set, Solver, Verbose
from .values import INFINITY, number, pair

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..case import Case
    from ..io.datasets import Result
    from ..study.workspace import Workspace
    from ..tabular import Tabular
    from .closing import Conclusion
P = ParamSpec("P")
INCOMPLETE = 3  # exit code: what was checked says that something may be missing from what was printed

CaseFile = Annotated[Path, typer.Argument(metavar="CASE", help="Case file (TOML).", show_default=False)]

@dataclass(frozen=True)
class Call:
    """What every verb is called with: the file it is about, what is to be changed, where results go and who reads them.

    solver: the one for everything that the program factorises, whatever case and environment say. told: warnings so
    far, each of which is said once; idle: finds settings without effect on what the verb computes, which are told with
    its results, for it may take the model.
    asked: options that stand for settings of the case, as they were given. unwritten, lost: files of results that could
    not be written, and why, which is told behind the results; aside: why files of places of their own could not, which
    keeps no others from being written; later: whether it is told behind the results, or raises at once.
    """

    path: Path
    set_: list[str] | None
    solver: str | None
    out: Path | None
    json: bool
    quiet: bool
    told: list[str] = field(default_factory=list[str])
    verb: str = ""
    idle: list[Callable[[], list[str]]] = field(default_factory=list[Callable[[], list[str]]])
    asked: list[tuple[str, ...]] = field(default_factory=list[tuple[str, ...]])
    writes: bool = True
    parts: tuple[str, ...] = ()
    stack: ExitStack = field(default_factory=ExitStack)
    unwritten: list[Path] = field(default_factory=list[Path])
    lost: list[AnalysisError] = field(default_factory=list[AnalysisError])
    aside: list[AnalysisError] = field(default_factory=list[AnalysisError])
    later: bool = True

    def claim(self) -> None:
        """Take the folder for results to oneself until the verb ends, where the verb writes into one. Raises CaseError
        where it cannot be written or another process is at it."""
        from ..io.claims import claimed

        if self.writes or self.out is not None:
            self.stack.enter_context(claimed(self.folder, self.parts))

    def case(self, **asked: Any) -> Case:
        """The case of `workspace`."""
        return self.workspace(**asked).case(self.verb)

    def workspace(
        self,
        source: str | None = None,
        max_frequency: float | None = None,
        friction_range: str | None = None,
        *,
        undamped: bool = False,
        stepper: str | None = None,
        range_option: str = "--range",
    ) -> Workspace:
        """The case in the file with overrides, its warnings printed and its folder claimed; settings without effect are
        told with the results. source, max_frequency [Hz], friction_range ("low:high"), undamped: options that stand for
        a setting of [modal], which the case then has; stepper: for one of [temporal]; range_option: what the range was
        given with. Raises CaseError.

        A verb asks for it before it imports what it computes with: what is wrong with the file is said at once."""
        from ..case import load

        named = {"solver": self.solver, "source": source}
        given = {"--source": source, "--max-frequency": max_frequency, "--range": friction_range}
        self.asked.extend((name, _as_typed(value)) for name, value in given.items() if value is not None)
        self.asked.extend([("--undamped",)] if undamped else [])
        self.asked.extend([] if stepper is None else [("--set", f"temporal.stepper={stepper}")])
        own = [f"modal.{key}={json.dumps(name)}" for key, name in named.items() if name is not None]
        if max_frequency is not None:
            if not 0.0 < max_frequency < INFINITY:
                raise CaseError("--max-frequency", max_frequency, "a highest frequency is a finite number > 0 [Hz]")
            own.append(f"modal.max_frequency_hz={max_frequency!r}")
        if friction_range is not None:
            own.append(f"modal.friction_range={list(self.range_of_friction(friction_range, range_option))}")
        if undamped:
            own.append("modal.damped=false")
        if stepper is not None:
            own.append(f"temporal.stepper={json.dumps(stepper)}")
        case = load(self.path, [*(self.set_ or ()), *own])
        if self.solver is not None and self.solver != "auto":
            os.environ["STRIDOR_SOLVER"] = self.solver
        self.warn_of(case)
        from ..study.workspace import Workspace
        from ..threads import limited

        work = Workspace(case)
        self.idle[:] = [partial(self._without_effect, work)]
        self.claim()
        self.stack.enter_context(limited())
        return work

    def _without_effect(self, work: Workspace) -> list[str]:
        """Settings that do nothing on the path that the verb takes; none where the model cannot be built, which the
        verb says."""
        from ..study.without_effect import without_effect

        try:
            return without_effect(work, self.verb, solver=self.solver)
        except StridorError:
            return []

    def warn(self, warnings: Iterable[str]) -> None:
        """Say warnings that have not been said yet; `document` lists them too."""
        for warning in warnings:
            if warning and warning not in self.told:
                self.told.append(warning)
                self.say(f"warning: {warning}")

    def warn_of(self, case: Case) -> None:
        """Say what is odd about a case before anything is computed."""
        self.warn(case.warnings)
        if case.imported:
            from ..study.unit_warnings import matrix_warnings

            self.warn(matrix_warnings(case))

    def warn_of_idle(self) -> None:
        """Say which settings had no effect."""
        while self.idle:
            self.warn(self.idle.pop()())

    def document(self, document: dict[str, Any]) -> None:
        """Print the JSON document of a verb, with a list ``warnings`` of all that was warned of."""
        from .output import print_json

        self.warn_of_idle()
        own = [w for w in document.get("warnings", ()) if w not in self.told]
        lost = [str(error) for error in (*self.aside, *self.lost)]
        if "files" in document:
            missing = {str(path) for path in self.unwritten}
            document = document | {"files": [name for name in document["files"] if name not in missing]}
        print_json({**document, "warnings": [*self.told, *own, *lost]})

    def check_friction(self, mu: float | Iterable[float] | None, where: str = "--mu") -> None:
        """Refuse friction coefficients asked for that none can be, warn of unusual ones. Raises CaseError."""
        from ..case.usual import MOST_FRICTION, TOO_MUCH, friction_oddity

        for value in [] if mu is None else [mu] if isinstance(mu, float | int) else mu:
            if not 0.0 <= value < INFINITY:
                raise CaseError(where, value, "a friction coefficient is a finite number ≥ 0")
            if value > MOST_FRICTION:
                raise CaseError(where, value, TOO_MUCH)
            self.warn([friction_oddity(where, value)])

    def range_of_friction(self, text: str, where: str = "--range") -> tuple[float, float]:
        """Two friction coefficients from "low:high", of which unusual ones are told. Raises CaseError."""
        low, high = pair(text, where)
        if not 0.0 <= low < high < INFINITY:
            raise CaseError(where, text, "low:high, two friction coefficients 0 ≤ low < high")
        self.check_friction((low, high), where)
        return low, high

    def one_friction(self, text: str | None) -> float | None:
        """The friction coefficient of --mu where a verb takes one; unusual ones are told. Raises CaseError."""
        if text is None:
            return None
        if "," in text or ":" in text:
            raise CaseError("--mu", text, f"one friction coefficient for {self.verb}; modes and compare take several")
        value = number(text, "--mu", least=0.0)
        self.check_friction(value)
        return value

    @property
    def folder(self) -> Path:
        """Where results go: the folder asked for, else CASE.out beside the case."""
        return self.out if self.out is not None else self.path.with_suffix(".out")

    def say(self, text: str) -> None:
        """A line of log."""
        from .output import say

        say(text, quiet=self.quiet)

    def conclude(self, found: Conclusion) -> None:
        """The last lines on stdout: the result in a sentence and, unless quiet, the command that comes next."""
        from .output import stdout

        self.warn_of_idle()
        if found.sentence:
            stdout.print(found.sentence)
        if found.verb:
            self.suggest(found.verb, *found.options)

    def suggest(self, verb: str, *options: str, path: Path | None = None) -> None:
        """Name the command that makes sense next, with the options that were given to this one; of another file those
        that say how to compute. Silent with --quiet."""
        from .closing import command
        from .output import literal, stdout

        if self.quiet:
            return
        given = [(name, value) for name, value in (("--solver", self.solver), ("--out", self.out)) if value is not None]
        changes = [("--set", change) for change in self.set_ or ()]
        kept = [] if path is not None else [*self.asked, *changes, *given]
        words = ["stridor", verb, str(path or self.path), *options]
        words += [str(word) for option in kept if verb in TABLE[option[0]].on for word in option]
        literal(f"Next: {command(words, stdout.page - 6)}")

    def write(self, path: Path, write: Callable[[], object]) -> Path:
        """Write a file of a result, and say so. What cannot be written is told behind the result, which is printed all
        the same, or (not ``later``) raises AnalysisError at once; behind one that is lost nothing more is written."""
        if not self.later:
            write()
        elif not self.lost:
            try:
                write()
            except AnalysisError as error:
                self.lost.append(error)
        if self.lost:
            self.unwritten.append(path)
        else:
            self.say(f"written: {path}")
        return path

    def tabulate(self, result: Tabular, name: str) -> Path:
        """Save a result as a CSV file in the folder, see `write`."""
        from ..io.csv_files import write_csv

        path = self.folder / name
        return self.write(path, lambda: write_csv(result, path))

    def draw(self, figure: Figure, name: str) -> Path:
        """Save a figure in the folder, see `write`."""
        from ..io.atomic import replacing
        from ..view.style import lay_out

        path = self.folder / name

        def drawn() -> None:
            lay_out(figure)
            with replacing(path) as temporary:
                figure.savefig(temporary, dpi=150)

        return self.write(path, drawn)

    def withdraw(self, *names: str) -> None:
        """Remove figures from the folder that are none of this result, which an earlier one left; say so."""
        for path in (self.folder / name for name in names):
            if path.is_file():
                path.unlink()
                self.say(f"removed: {path}, of an earlier result; this one has none to draw")

    def keep(self, result: Result, name: str) -> Path:
        """Save a result as a dataset in the folder, or where there is room for it, see `write`."""
        from ..io.datasets import save

        path = self.folder / name

        def saved() -> None:
            try:
                save(result, path)
            except AnalysisError as error:
                elsewhere = self._elsewhere(lambda other: save(result, other), name, error)
                raise AnalysisError(f"{error}; the result is in {elsewhere}") from None

        return self.write(path, saved)

    def keep_at(self, path: Path, what: str, write: Callable[[Path], Path]) -> Path:
        """Write a file at a place of its own, or where there is room for it, and say so. That it could not be written
        is told behind the results, which are written all the same."""
        try:
            self.say(f"written: {write(path)}")
        except AnalysisError as error:
            self.unwritten.append(path)
            self.aside.append(error)
            with suppress(AnalysisError):  # told already where there is room nowhere
                self.aside[-1] = AnalysisError(f"{error}; {what} is in {self._elsewhere(write, path.name, error)}")
        return path

    def _elsewhere(self, write: Callable[[Path], Path], name: str, error: AnalysisError) -> Path:
        """Save what was computed where there is room for it. Raises the error that there was where there is none."""
        for folder in (Path.cwd(), Path(tempfile.gettempdir())):
            path = folder / f"{self.path.stem}-{os.getpid()}-{name}"
            with suppress(AnalysisError):
                return write(path)
        raise error


def _common(
    case: CaseFile, set_: Set = None, solver: Solver = None, out: Out = None, json: Json = False,
    quiet: Quiet = False, verbose: Verbose = False,
) -> Call:  # fmt: skip
    if quiet and verbose:
        raise CaseError("--verbose", None, "says what --quiet leaves out; take one of them")
    log = logging.getLogger("stridor")
    log.setLevel(logging.ERROR if quiet else logging.DEBUG if verbose else logging.NOTSET)
    call = Call(case, set_, solver, out, json, quiet)
    if verbose:
        from .output import Log

        handler = Log()
        log.addHandler(handler)
        call.stack.callback(log.removeHandler, handler)
    return call


# Arguments of analyses that options of another name stand for.
_STANDS_FOR = {
    "grid": "points", "max_frequency_hz": "max_frequency", "band_hz": "band", "numbers": "parameter",
    "parameters": "parameter", "target": "branch", "modes": "branch",
    "modal.source": "source", "modal.solver": "solver",
}  # fmt: skip


def by_option(error: CaseError, options: Mapping[str, str], given: Mapping[str, Any]) -> CaseError:
    """The error with options in place of the arguments of analyses that they stand for, as its user wrote them.

    options: those of the verb by the names of its arguments; given: their values. What is a setting of the case too is
    that of the option only where this was given."""

    def where(name: str) -> str:
        first, dot, rest = name.partition(".")
        if first == "box" and dot:
            return f"--box {rest}" if "box" in options else rest
        own = _STANDS_FOR.get(name, name)
        if own not in options or (name.startswith("modal.") and given.get(own) is None):
            return name
        return options[own]

    return CaseError.many([replace(problem, where=where(problem.where)) for problem in error.problems])


def _as_typed(value: object) -> str:
    """A value of an option as one would type it: 10000, not 10000.0."""
    return f"{value:.15g}" if isinstance(value, float) and float(f"{value:.15g}") == value else str(value)


def _options(parameters: Iterable[inspect.Parameter]) -> dict[str, str]:
    """Names of options by those of arguments."""
    found: dict[str, str] = {}
    for parameter in parameters:
        told = parameter.annotation.__metadata__[0]
        if isinstance(told, typer.models.OptionInfo):
            words = [str(word) for word in (told.default, *(told.param_decls or ())) if str(word).startswith("--")]
            found[parameter.name] = words[0]
    return found


def _has(parameter: inspect.Parameter, verb: str) -> bool:
    """Whether a verb has one of the common options, by the table."""
    told = parameter.annotation.__metadata__[0]
    return any(option.described is told and verb in option.on for option in TABLE.values())


def verb(
    file: Any = CaseFile, *, writes: bool = True, parts: tuple[str, ...] = ()
) -> Callable[[Callable[Concatenate[Call, P], None]], Callable[..., None]]:
    """Give a function the arguments that all verbs have: the file before its own, the others after, as one `Call`.

    writes: whether it writes results without being asked to by --out; parts: the folders in that for results that it
    writes into as well.
    """

    def made(function: Callable[Concatenate[Call, P], None]) -> Callable[..., None]:
        case, *every = inspect.signature(_common, eval_str=True).parameters.values()
        name = function.__name__.replace("_", "-")  # ty: ignore[missing-attribute]  # typer takes functions alone
        common = [p for p in every if _has(p, name)]
        _, *own = inspect.signature(function, eval_str=True).parameters.values()
        names, options = [p.name for p in (case, *common)], _options((*own, *common))

        @wraps(function)
        def called(**given: Any) -> None:
            heap.keep()
            as_given = dict(given)
            call = replace(
                _common(**{name: given.pop(name) for name in names}),
                verb=name,
                writes=writes,
                parts=parts,
            )
            width = shutil.get_terminal_size().columns
            with beating(quiet=call.quiet, terminal=sys.stderr.isatty(), width=width, verb=call.verb), call.stack:
                try:
                    function(call, **given)  # type: ignore[call-arg]
                except CaseError as error:
                    raise by_option(error, options, as_given) from error
                except AnalysisError as error:
                    call.warn([str(lost) for lost in (*call.aside, *call.lost) if lost is not error])
                    raise
                except typer.Exit:
                    if not call.lost and not call.aside:
                        raise
            call.warn_of_idle()
            if lost := [*call.aside, *call.lost]:
                call.warn([str(error) for error in lost[:-1]])
                raise lost[-1]
            interrupts.check()

        order = (case.replace(annotation=file), *own, *common)
        # Typer takes them one by one, after one another, by keyword.
        called.__signature__ = inspect.Signature(  # type: ignore[attr-defined]  # ty: ignore[missing-attribute]
            [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in order]
        )
        return called

    return made
