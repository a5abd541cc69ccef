"""A page of the documentation, followed from its first line to its last: commands run, files written, numbers compared.

Fenced blocks without a language, or `sh`, hold commands: `stridor …` is run, lines after `$ stridor …` are its output. `toml`
blocks that begin with a comment `# name.toml` are written as that file; others are parts of case files, whose keys and values
must be known. `python` blocks run in one namespace; `expression  # → value` shows what comes out, on a line of its own
`# → value` what the line above gives. Notes for this engine are comments of the page, before a block unless said otherwise:

    <!-- not run: why -->                  the options of its commands are read, its Python is compiled, no more
    <!-- slow -->, <!-- slow: run -->      the block, or commands of these verbs, in the weekly run alone
    <!-- with: --set a=1 -->               words added to each command of the block: a coarser mesh
    <!-- first: … -->                      commands, or Python, that are run and not shown
    <!-- held: 0.0767 8635 -->             after a paragraph: numbers in it that the last command printed
    <!-- holds: expression -->             anywhere: Python that must be true
"""

from __future__ import annotations

import ast
import contextlib
import re
import shlex
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path

import pytest
import typer

import stridor as st
from program import stridor
from stridor.app.cli import app

ROOT = Path(__file__).parents[1]
PIECE = re.compile(r"^```(?P<language>[^\n]*)\n(?P<code>.*?)^```$|^<!-- *(?P<note>.*?) *-->$", re.MULTILINE | re.DOTALL)
SPHINX = ("{", "text")  # blocks that the documentation's own build reads, and text that nobody types
MISSING = re.compile(
    r"(: missing – |– no such |– needs contacts )"
)  # of a part of a case file: what the rest would have
NUMBER = re.compile(r"[-+−]?\d[\d ]*\.?\d*(?:e[-+]?\d+)?")


@dataclass
class Page:
    """What was done so far on one page."""

    path: Path
    folder: Path
    slow: bool
    printed: dict[str, str] = field(default_factory=dict[str, str])
    warned: str = ""
    names: dict[str, object] = field(default_factory=dict[str, object])
    skipped: bool = False
    last: str | None = None

    def follow(self) -> Page:
        """Everything on the page, in order."""
        text = self.path.read_text(encoding="utf-8")
        notes: list[str] = []
        for piece in PIECE.finditer(text):
            if piece["note"] is not None:
                if not self._noted(piece["note"], text[: piece.start()]):
                    notes.append(piece["note"])
            elif not piece["language"].startswith(SPHINX):
                self._block(piece["language"], piece["code"], notes)
                notes = []
        assert not notes, f"{self.path.name}: a note without a block: {notes}"
        return self

    def _noted(self, note: str, before: str) -> bool:
        """Does what stands by itself; False of what is about the next block."""
        kind, _, said = note.partition(":")
        if kind == "first":
            commands = [line.strip() for line in said.strip().splitlines()]
            if all(line.startswith("stridor ") for line in commands):
                for command in commands:
                    self._run(command, [])
            else:
                self._python(said.strip())
        elif kind == "held":
            if self.last is not None:
                self._held(said.split(), before.rstrip().rpartition("\n\n")[2])
        elif kind == "holds":
            if not self.skipped:
                assert eval(said.strip(), self.names), f"{self.path.name}: {said}"
        else:
            assert re.match(r"(not run|with): \S|slow\b", note), f"{self.path.name}: unknown note {note!r}"
            return False
        return True

    def _block(self, language: str, code: str, notes: list[str]) -> None:
        kinds = {note.partition(":")[0]: note.partition(":")[2].strip() for note in notes}
        left = "not run" in kinds or ("slow" in kinds and not kinds["slow"] and not self.slow)
        if language == "toml":
            self._toml(code)
        elif language == "python":
            compile(code, self.path.name, "exec")
            self.skipped = left
            if not left:
                self._python(code)
        else:
            assert language in ("", "sh"), f"{self.path.name}: what is a block of {language}?"
            self._commands(code, kinds, left)

    def _commands(self, code: str, kinds: dict[str, str], left: bool) -> None:
        late = {verb.strip() for verb in kinds.get("slow", "").split(",")} if not self.slow else set()
        lines = code.replace("\\\n", " ").splitlines()
        shown = any(line.startswith("$ ") for line in lines)
        starts = [i for i, line in enumerate(lines) if line.startswith("$ ") or (line.strip() and not shown)]
        assert starts, f"{self.path.name}: no command in\n{code}"
        for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
            command = re.split(r"\s+# ", lines[start].removeprefix("$ "))[0].strip()
            if not command.startswith("stridor "):
                assert "not run" in kinds, (
                    f"{self.path.name}: not a command of stridor, and no note says why it is not run: {command}"
                )
            elif left or command.split()[1] in late:
                _options_known(command)
                self.last = None
            else:
                output = self._run(command, shlex.split(kinds.get("with", "")))
                assert_shown(lines[start + 1 : end], output)

    def _run(self, command: str, more: list[str]) -> str:
        done = stridor(*shlex.split(command)[1:], *more, cwd=self.folder)
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        self.last = command
        self.warned += done.stderr
        self.printed[command] = done.stdout
        return done.stdout

    def _toml(self, code: str) -> None:
        name = re.match(r"# (\S+\.toml)\n", code)
        if name:
            (self.folder / name[1]).write_text(code, encoding="utf-8")
            return
        try:
            st.loads(code)
        except st.CaseError as error:
            wrong = [line for line in str(error).splitlines() if not MISSING.search(line)]
            assert not wrong, f"{self.path.name}: {wrong}"

    def _python(self, code: str) -> None:
        lines = [*code.splitlines(), ""]
        with contextlib.chdir(self.folder):
            for statement in ast.parse(code, self.path.name).body:
                end = int(statement.end_lineno or 0)
                below = lines[end] if lines[end].startswith("# → ") else ""
                value = (below or lines[end - 1]).partition("# → ")[2]
                if value:
                    assert isinstance(statement, ast.Expr), f"{self.path.name}: no expression shows {value}"
                    found = eval(compile(ast.Expression(statement.value), self.path.name, "eval"), self.names)
                    assert_shown([value], str(found), half=True)
                else:
                    exec(compile(ast.Module([statement], []), self.path.name, "exec"), self.names)

    def _held(self, numbers: list[str], paragraph: str) -> None:
        output = self.printed[str(self.last)]
        found = [number.replace(" ", "") for number in NUMBER.findall(output)]
        for number in numbers:
            assert number in paragraph.replace(" ", ""), f"{self.path.name}: {number} is not in\n{paragraph}"
            assert any(alike(number, other, half=True) for other in found), (
                f"{self.path.name}: {number} is not in the output\n{output}"
            )


def assert_shown(lines: list[str], output: str, *, half: bool = False) -> None:
    """Lines shown stand in the output one after another, a line `…` for any; numbers agree to the digits shown."""
    printed, at = output.splitlines(), 0
    anywhere = True
    for line in (line for line in lines if line.strip()):
        if line.strip() == "…":
            anywhere = True
            continue
        rest = [i for i, other in enumerate(printed) if i >= at and other.strip()]
        found = [i for i in (rest if anywhere else rest[:1]) if _alike_line(line, printed[i], half)]
        assert found, f"not printed: {line}\n{output}"
        at, anywhere = found[0] + 1, False


def _alike_line(shown: str, printed: str, half: bool) -> bool:
    words, own = shown.split(), printed.split()
    return len(words) == len(own) and all(alike(word, other, half=half) for word, other in zip(words, own, strict=True))


def alike(shown: str, printed: str, *, half: bool = False) -> bool:
    """Two words that are the same, or numbers within one unit of the last digit shown (half: rounded to it)."""
    try:
        one, other = (Decimal(word.strip(";,.()").replace("−", "-")) for word in (shown, printed))
    except InvalidOperation:
        return shown == printed
    unit = Decimal(1).scaleb(int(one.as_tuple().exponent))
    half = half or abs(one) < 100 * unit  # few digits are no rounding
    # Backward errors are rounding: of those it is shown that they are small.
    return abs(one - other) <= (unit / 2 if half else unit) or max(abs(one), abs(other)) < Decimal("1e-9")


def _options_known(command: str) -> None:
    """A command that is not run: its verb and its options exist."""
    words = shlex.split(command)[1:]
    verb = vars(typer.main.get_command(app))["commands"].get(words[0])
    assert verb is not None, f"no such verb: {command}"
    try:
        verb.make_context(words[0], words[1:])
    except Exception as error:  # typer's own usage errors, or values that its callbacks refuse
        pytest.fail(f"{command}: {error}")
