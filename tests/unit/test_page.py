"""What is printed fits a page of 80 columns, ends with the result in a sentence, and says which command comes next."""

from __future__ import annotations

import re
import shlex
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mode_coupling import mode_coupling
from program import on_terminal, stridor
from stridor.app import output, tables
from stridor.app.arguments import Call
from stridor.app.closing import command
from stridor.app.conclusions import of_countermeasures
from stridor.app.explore import show_countermeasures
from stridor.app.output import _filled, stdout
from stridor.study.measures import Countermeasures, Measure, Verified
from undrawn import nothing_drawn

COARSE = [
    "--set", "bodies.beam1.elements=6", "--set", "bodies.beam2.elements=18", "--set", "temporal.step=4e-7",
    "--set", "temporal.record_every=5", "--set", "phases.press.duration=0.002", "--set", "phases.slide.duration=0.004",
]  # fmt: skip
DAMPING = "bodies.beam1.damping.stiffness", "bodies.beam2.damping.stiffness"
MAP = ["--x", DAMPING[0], "--y", DAMPING[1], "--x-range", "1e-9:5e-8", "--y-range", "1e-9:5e-8", "--points", "9"]
MESHES = (
    "--set bodies.disc.mesh.divisions=[2,24,1] --set bodies.lining.mesh.divisions=[2,6,1] "
    "--set bodies.plate.mesh.divisions=[2,6,1]"
)
NEXT = "Next: stridor "

# What each verb ends with, and what it names as the next command.
ENDS = {
    "check two-beams.toml": ("time loop: modal path ", "onsets two-beams.toml"),
    "check pad-on-disc.toml": ("time loop: assembled path ", "onsets pad-on-disc.toml"),
    "steady pad-on-disc.toml": ("458 of 465 slave nodes touch, 0 stick and 458 slip; ", "modes pad-on-disc.toml"),
    f"steady pad-on-disc.toml {MESHES}": (
        "21 of 21 slave nodes touch, 0 stick and 21 slip; ", f"modes pad-on-disc.toml {MESHES}"
    ),
    "modes two-beams.toml": (
        "1 of 19 modes up to 40000 Hz is unstable at μ = 0.1; the fastest 8641.12 Hz, +637.328 1/s",
        "shapes two-beams.toml --branch 8",
    ),
    "modes two-beams.toml --mu 0.2 --band 100:9000": (
        "1 of 10 modes from 100 to 9000 Hz is unstable at μ = 0.2; the fastest 8667.05 Hz, +1547.32 1/s",
        "shapes two-beams.toml --mu 0.2 --branch 8",
    ),
    "modes two-beams.toml --mu 0.01 --max-frequency 9e3": (
        "none of 10 modes up to 9000 Hz is unstable at μ = 0.01", "onsets two-beams.toml --max-frequency 9000"
    ),
    "modes two-beams.toml --mu 0:0.2:11": (
        "unstable modes at 7 of 11 friction coefficients, the lowest 0.08; the fastest at μ = 0.2: ",
        "onsets two-beams.toml",
    ),
    "onsets two-beams.toml": (
        "4 onsets for μ in 0 … 1 up to 40000 Hz; growth begins at μ = 0.076725, 8635.43 Hz",
        "modes two-beams.toml --mu 0.0844",
    ),
    "onsets two-beams.toml --range 0:0.05": ("no onset for μ in 0 … 0.05 up to 40000 Hz", "modes two-beams.toml"),
    "onsets two-beams.toml --range 0.1:0.12": (
        "unstable from the start of the range, μ = 0.1", "modes two-beams.toml --mu 0.1"
    ),
    "shapes two-beams.toml": (
        "1 mode drawn; the fastest: mode 8, 8641.12 Hz, +637.328 1/s", "countermeasures two-beams.toml --branch 8"
    ),
    "shapes two-beams.toml --mu 0.01": ("1 mode drawn, none of them unstable", "onsets two-beams.toml"),
    "sensitivities two-beams.toml --parameter materials.steel.young_modulus --parameter mu": (
        "a per cent more of mu changes the growth of mode 8 most: +14.63 1/s", "countermeasures two-beams.toml"
    ),
    "countermeasures two-beams.toml --verify 1": (
        "best: add 0.000293 kg to beam1 at (0.1, 0) m, takes 637.33 1/s away, solved again; nothing grows then",
        "modes two-beams.toml --set materials.steel.young_modulus=1.9e+11",
    ),
    "countermeasures two-beams.toml --mu 0.01": (
        "no mode is unstable at μ = 0.01: there is nothing to remove", "modes two-beams.toml --mu 0.01"
    ),
    "reduce two-beams.toml --box mu=0:0.3 --box contact_stiffness=0.5:2 --at mu=0.05,0.1,0.4": (
        "unstable modes at 2 of 3 points; the fastest ",
        "reduce two-beams.toml --onsets mu --box mu=0:0.3 --box contact_stiffness=0.5:2",
    ),
    "reduce two-beams.toml --onsets mu": (
        "4 onsets along mu in 0 … 1 up to 40000 Hz; growth begins at 0.0767252, 8635.43 Hz",
        "reduce two-beams.toml --at mu=0:1:5",
    ),
    f"damping-map two-beams.toml {' '.join(MAP)}": (
        "over both numbers the lowest onset goes from μ = 0.076493 to 0.077144",
        f"onsets two-beams.toml --set {DAMPING[0]}=1e-09 --set {DAMPING[1]}=5e-08",
    ),
    f"boundary two-beams.toml --x {DAMPING[0]} --x-range 1e-9:5e-8 --y mu --y-range 0:0.2 --lines 3": (
        "1 of 3 curves bounds where nothing grows, down to ",
        f"modes two-beams.toml --set {DAMPING[0]}=1e-09 --mu 0.0766642",
    ),
    f"boundary two-beams.toml --x {DAMPING[0]} --x-range 1e-9:5e-8 --y mu --y-range 0:0.2 --lines 2 --max-frequency 9e3": (
        "one curve bounds where nothing grows, down to ",
        f"modes two-beams.toml --set {DAMPING[0]}=1e-09 --mu 0.0766642 --max-frequency 9000",
    ),
    "ensemble two-beams.toml --mu 0.3 --load 0.5,0.5 COARSE": (
        "2 members: ", "modes two-beams.toml --mu 0.3 COARSE"
    ),
    "cycles rub.toml --mu 1.0": (
        "1 limit cycle at μ = 1: 1 stable", "simulate rub.toml --stepper exact --mu 1"
    ),
    "simulate two-beams.toml COARSE": ("last phase: 5970.1 Hz is the strongest line, ", "compare two-beams.toml COARSE"),
    "compare two-beams.toml --no-critical COARSE": (
        "agree: μ = 0.1: both unstable at 8651.1 Hz, growth 642.2 against 641.6 1/s (0.1 %)",
        "run two-beams.toml COARSE",
    ),
    "run two-beams.toml --only modes,onsets --skip report COARSE": (
        "modal onset at μ = 0.07634, 8645.3 Hz; no comparison was made", "shapes two-beams.toml COARSE"
    ),
    "report two-beams.toml COARSE": (
        "modal onset at μ = 0.07634, 8645.3 Hz; no comparison was made", "shapes two-beams.toml COARSE"
    ),
    "export two-beams.toml --out there": ("columns of loads: press", "onsets there/matrices.toml"),
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def no_pictures() -> Generator[None]:
    with nothing_drawn():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page")
    (path / "rub.toml").write_text(mode_coupling(0.02, 0.1).text, encoding="utf-8")
    for name in ("two-beams", "pad-on-disc"):
        done = stridor("new", name, cwd=path)
        assert done.stdout == f"{NEXT}check {name}.toml\n"
        done = stridor("new", name, "--quiet", "--force", cwd=path)
        assert (done.stdout, done.stderr) == ("", "")
    return path


def words_of(text: str) -> list[str]:
    return shlex.split(text.replace("COARSE", " ".join(COARSE)))


LONG = (
    "check pad-on-disc.toml", "steady pad-on-disc.toml", f"damping-map two-beams.toml {' '.join(MAP)}",
    f"boundary two-beams.toml --x {DAMPING[0]} --x-range 1e-9:5e-8 --y mu --y-range 0:0.2 --lines 3",
)  # fmt: skip


@pytest.mark.parametrize("words", [pytest.param(w, marks=[pytest.mark.slow] if w in LONG else []) for w in ENDS])
def test_every_verb_fits_the_page_and_ends_with_its_result(
    folder: Path, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    done = stridor(*words_of(words), cwd=folder)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "…" not in done.stdout.replace(" … ", "")  # no cell is cut
    result, following = ENDS[words]
    body, _, hint = done.stdout.partition(NEXT)
    assert shlex.split(hint.replace("\\\n", " ")) == words_of(following)
    assert " ".join(body.split()).rpartition(result)[1] == result
    assert " ".join(body.splitlines()[-4:]).count(result.split()[0]), "the result stands last"


def test_hints_are_quiet_and_documents_have_none(folder: Path) -> None:
    quiet = stridor("modes", "two-beams.toml", "--quiet", cwd=folder)
    assert quiet.stdout.splitlines()[-1].split()[-1] == "1/s"
    assert "Next" not in quiet.stdout
    assert "Next" not in stridor("modes", "two-beams.toml", "--json", cwd=folder).stdout


def test_what_was_asked_for_goes_into_the_next_command(folder: Path) -> None:
    asked = ["--set", "title='a, b'", "--max-frequency", "9000", "--undamped", "--source", "receptance", "--out", "x y"]
    done = stridor("modes", "two-beams.toml", "--mu", "0.2", *asked, cwd=folder)
    hint = shlex.split(done.stdout.partition("Next: ")[2].replace("\\\n", " "))
    assert hint[:4] == ["stridor", "shapes", "two-beams.toml", "--mu"]
    assert {"--undamped", "--source", "receptance", "--max-frequency", "9000", "title='a, b'", "x y"} <= set(hint)
    assert stridor(*hint[1:], "--quiet", cwd=folder).returncode == 0
    # What the next verb does not take is left out.
    steady = stridor("onsets", "two-beams.toml", "--range", "0:0.05", cwd=folder).stdout
    assert "--range" not in steady.partition("Next: ")[2]


def test_what_does_not_slide_is_sent_to_nothing_that_needs_sliding(folder: Path) -> None:
    text = (folder / "two-beams.toml").read_text()
    (folder / "still.toml").write_text(text.replace("velocity = { x = 0.02 }", "velocity = { x = 0.0 }"))
    checked = stridor("check", "still.toml", cwd=folder)
    assert "no steady sliding: contact A does not slide" in " ".join(checked.stdout.split())
    assert checked.stdout.splitlines()[-1] == "Next: stridor simulate still.toml"
    marched = stridor("simulate", "still.toml", *COARSE, cwd=folder)
    assert (marched.returncode, "Next" in marched.stdout) == (0, False)


def test_a_command_breaks_between_options_only() -> None:
    text = command(["stridor", "modes", "a b.toml", "--mu", "0.3", "--set", "x.y=1", "--undamped", "--out", "f"], 40)
    assert text == "stridor modes 'a b.toml' --mu 0.3 \\\n    --set x.y=1 --undamped --out f"


def test_sentences_break_between_words_and_keep_numbers_with_their_units() -> None:
    text = _filled("  the fastest at μ = 0.2 is 8641.12 Hz, +637.328 1/s and a/very/long/path/that/is/whole.toml", 27)
    assert text.splitlines() == [
        "  the fastest at μ = 0.2 is", "    8641.12 Hz,", "    +637.328 1/s and", "    a/very/long/path/that/is/whole.toml"
    ]  # fmt: skip


def test_columns_go_by_importance_and_are_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    heads, rows = ["name", "growth rate [1/s]", "residual", "what it is"], [["a", "1.5", "1e-16", "words that go on"]]
    for width, expected in (
        (60, ["  name  growth rate [1/s]  residual  what it is", "     a                1.5     1e-16  words that go on"]),
        (50, ["        growth rate", "  name        [1/s]  residual  what it is"]),
        (46, ["        growth", "          rate", "  name   [1/s]  residual  what it is"]),
        (40, ["        growth rate", "  name        [1/s]  what it is", "     a          1.5  words that go on"]),
    ):
        monkeypatch.setenv("COLUMNS", str(width))
        gone = tables.table("T", heads, rows, drop=["residual"], words=["what it is"], kept_in="a.csv")
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "T"
        assert lines[1 : 1 + len(expected)] == expected
        assert max(map(len, lines)) <= width
        assert (gone == ["residual"]) == (width == 40)
        assert ("not shown, for want of room: residual; in a.csv" in " ".join(" ".join(lines).split())) == bool(gone)


def test_a_bar_is_there_while_something_is_under_way(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is refused before it begins draws none, and what comes after it is told of without it."""
    monkeypatch.setattr(output, "stderr", output._Screen(stderr=True, force_terminal=True, soft_wrap=True))
    with output.progress_bar("simulate", quiet=False) as progress:
        assert capsys.readouterr().err == ""
        progress(3, 10)
        output.stderr.print("below it")
        assert "simulate" in capsys.readouterr().err
        progress(10, 10)
        capsys.readouterr()
        output.stderr.print("compare")
        assert capsys.readouterr().err == "compare\n"
    assert capsys.readouterr().err == ""


def test_warnings_and_notes_fit_the_page_and_errors_that_of_a_terminal(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    words = ["modes", "two-beams.toml", "--mu", "0.2,40", "--out", "deep"]
    told = stridor(*words, cwd=folder).stderr
    assert "warning: --mu: 40 is unusual" in told
    assert "\n  " in told
    assert max(map(len, told.splitlines())) <= 60
    # A problem is a line, for other programs to read; on a terminal it breaks between words.
    wrong = ["modes", "two-beams.toml", "--set", "bodies.beam1.elements=many"]
    line = stridor(*wrong, cwd=folder).stderr
    assert line.count("\n") == 1
    code, shown = on_terminal(*wrong, cwd=folder)
    shown = shown.replace("\r\n", "\n")
    assert code == 2, shown
    assert len(line) > 81
    assert max(map(len, shown.splitlines())) <= 80
    assert " ".join(shown.split()) == line.strip()


@pytest.mark.parametrize(
    "words", ["compare two-beams.toml --only growth COARSE", "modes two-beams.toml", "report two-beams.toml --skip modes,onsets"]
)
def test_warnings_stand_before_the_result(folder: Path, words: str) -> None:
    code, shown = on_terminal(*words_of(words), "--solver", "superlu", "--out", "warned", cwd=folder)
    assert code == 0, shown
    body, following, after = shown.partition(NEXT)
    assert "warning: --solver has no effect" in body
    assert following
    assert "warning" not in after + body.splitlines()[-1]


@pytest.mark.parametrize("colours", [True, False])
def test_a_terminal_has_unstable_modes_in_red_unless_no_color_is_set(folder: Path, *, colours: bool) -> None:
    more = {} if colours else {"NO_COLOR": "1"}
    code, shown = on_terminal("modes", "two-beams.toml", "--set", "modal.sweep_points=6", cwd=folder, **more)
    assert code == 0, shown
    red = re.findall(r"\x1b\[31m([^\x1b]*)", shown)
    assert ("8641.12" in " ".join(red)) == colours
    assert not colours or not any("-716.799" in text for text in red)
    lines = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", shown).replace("\r\n", "\n").split("\n")
    assert max(len(line.rpartition("\r")[2]) for line in lines) <= 80
    assert stdout.page == 80  # of a pipe, as here


def change(name: str, removed: float, again: float | None) -> Measure:
    verified = None if again is None else Verified(1.0, 1e3, again, again, (1e3,))
    return Measure("number", name, 1, 5.0, removed / 5, removed / 5, removed, np.zeros(1, complex), (), (), None, None, verified)


@pytest.mark.parametrize(
    ("changes", "said", "set_to"),
    [
        # What was predicted to help most and makes things worse is neither called best nor gone on with.
        ([change("a", 9.0, -4.0), change("b", 5.0, 2.0), change("c", 3.0, 6.0)], "best: raise c by 5 %, takes 6.000 1/s", "c=2.1"),
        ([change("a", 9.0, -4.0), change("b", 5.0, None)],
         "1 change solved again, and none takes growth away; best: raise b by 5 %, predicted to take 5.000 1/s away", "b=2.1"),
        ([change("a", 9.0, -4.0)], "no change takes growth away", None),
    ],
)  # fmt: skip
def test_the_best_change_is_one_that_helped_when_solved_again(changes: list[Measure], said: str, set_to: str | None) -> None:
    result = Countermeasures(0.3, "sum", np.array([1]), np.array([1j]), tuple(changes), 0.01)
    conclusion = of_countermeasures(result, lambda _: 2.0, None)
    assert conclusion.sentence.startswith(said)
    assert (conclusion.options[-1] if conclusion.options else None) == set_to


def test_counter_measures_take_one_screen(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    harm = Verified(9.0, 6490.0, -9.0, -9.0, tuple(np.linspace(2e3, 9e3, 30)))
    many = [replace(change(f"materials.lining.young_modulus_{k}", 40.0 - k, None), makes_unstable=tuple(range(20))) for k in range(25)]
    many[:3] = [replace(m, verified=harm) for m in many[:3]]
    result = Countermeasures(0.3, "sum", np.array([1]), np.array([1j]), tuple(many), 0.01)
    show_countermeasures(Call(tmp_path / "case.toml", None, None, None, json=False, quiet=False), result)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 34  # with result, hints and notes no more than 40
    assert "  18 more of 25, predicted to take less per % away, in countermeasures.csv" in lines
    assert max(map(len, lines)) <= 80
    printed = " ".join(" ".join(lines).split())
    assert "young_modulus_6" in printed
    assert "young_modulus_7" not in printed
    assert "and 17 more" in printed
    assert "and 27 more" in printed
    # What was solved again is shown however many there are.
    verified = replace(result, measures=tuple(replace(m, verified=harm) for m in many[:12]))
    show_countermeasures(Call(tmp_path / "case.toml", None, None, None, json=False, quiet=False), verified)
    shown = capsys.readouterr().out
    assert "young_modulus_11" in shown
    assert "more of" not in shown
