"""One name, one meaning: every verb takes its options from one table, and the documentation shows that table."""

from __future__ import annotations

import csv
import inspect
import json
import re
import typing
from pathlib import Path

import numpy as np
import pytest
import typer

import stridor as st
from program import stridor
from stridor.app import arguments, option_table
from stridor.app.cli import app
from stridor.app.option_table import COMPUTING, EVERY, PAGES, READING, TABLE
from stridor.errors import CaseError
from undrawn import nothing_drawn

DOCS = Path(__file__).parents[2] / "docs" / "commands.md"


def options_of_verbs() -> dict[str, dict[str, tuple[typing.Any, typing.Any, typing.Any]]]:
    """Of every verb its options by name: type, what typer was told, default."""
    found: dict[str, dict[str, tuple[typing.Any, typing.Any, typing.Any]]] = {}
    for command in app.registered_commands:
        assert command.callback is not None
        own = found.setdefault(str(command.name), {})
        for parameter in inspect.signature(command.callback, eval_str=True).parameters.values():
            kind, told = typing.get_args(parameter.annotation)
            if isinstance(told, typer.models.OptionInfo):
                # typer takes the first of its words for a default where it does not stand in Annotated
                name = next(str(word) for word in (told.default, *told.param_decls) if str(word).startswith("--"))
                own[name.split("/")[0]] = kind, told, parameter.default
    return found


VERBS = options_of_verbs()


def test_the_verbs_are_those_of_the_table() -> None:
    assert set(VERBS) == {*EVERY, *PAGES}


@pytest.mark.parametrize("name", sorted({name for own in VERBS.values() for name in own}))
def test_an_option_of_one_name_is_the_same_on_every_verb(name: str) -> None:
    kinds = [own[name] for own in VERBS.values() if name in own]
    first, told, default = kinds[0]
    for kind, other, value in kinds[1:]:
        assert (kind, value) == (first, default)
        if name == "--method":  # curves and cycles have ways of their own
            continue
        assert (other.metavar, other.help, other.min) == (told.metavar, told.help, told.min)


@pytest.mark.parametrize("name", sorted(TABLE))
def test_every_verb_has_each_option_that_the_table_says_and_no_other(name: str) -> None:
    option = TABLE[name]
    assert {verb for verb, own in VERBS.items() if name in own} == set(option.on)
    for verb in option.on:
        assert VERBS[verb][name][1] is option.described
    if name != "--force":  # of files that are written once and edited: no verb that computes has it
        assert set(COMPUTING) - set(option.on) == set(option.lacks)
    assert all(why and " " not in why for why in option.lacks.values())


def test_the_documentation_shows_the_table() -> None:
    text = DOCS.read_text(encoding="utf-8")
    missing = [line for line in option_table.rows() if line not in text.splitlines()]
    assert not missing, "put these lines into docs/commands.md:\n" + "\n".join(missing)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("options")
    assert stridor("new", "two-beams", "--quiet", cwd=path).returncode == 0
    return path


def run(folder: Path, *words: str) -> dict[str, typing.Any]:
    with nothing_drawn():
        done = stridor(words[0], "two-beams.toml", *words[1:], "--json", "--quiet", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_band_of_modes_is_said_to_be_one_wherever_they_are_written(folder: Path) -> None:
    every = {m["branch"]: m for m in run(folder, "modes", "--max-frequency", "20e3")["modes"][0]}
    drawn = stridor("modes", "two-beams.toml", "--band", "5000:8641.05", "--max-frequency", "20e3", "--json", cwd=folder)
    found = json.loads(drawn.stdout)
    (listed,) = found["modes"]
    assert {m["branch"]: m for m in listed} == {k: m for k, m in every.items() if 5000 <= m["frequency_hz"] <= 8641.05}
    assert [m["branch"] for m in listed] == [7, 9, 10]  # numbers are those of the whole list; 8 is at 8641.12 Hz
    assert found["band_hz"] == [5000.0, 8641.05]
    assert (found["modes_in_band"], found["unstable_modes"], found["unstable_outside_band"]) == ([3], [0], [1])
    assert found["max_frequency_hz"] == 20e3
    rows = list(csv.DictReader((folder / "two-beams.out" / "modes.csv").open(encoding="utf-8")))
    assert [r["branch"] for r in rows] == ["7", "9", "10"]
    assert (folder / "two-beams.out" / "modes.png").stat().st_size > 5000
    assert {(r["band_low_hz"], r["band_high_hz"]) for r in rows} == {("5000.0", "8641.05")}
    data = st.open(folder / "two-beams.out" / "modes.nc")
    assert data.attrs["band_hz"].tolist() == [5000.0, 8641.05]
    assert data["branch"].values.tolist() == [7, 9, 10]


def test_a_band_goes_with_the_other_options_of_modes(folder: Path) -> None:
    fastest = run(folder, "modes", "--band", "5000:9000", "--sort", "growth")["modes"][0]
    assert [m["branch"] for m in fastest] == [8, 7, 9, 10]
    assert [m["branch"] for m in run(folder, "modes", "--band", "5000:9000", "--unstable")["modes"][0]] == [8]
    few = run(folder, "modes", "--band", "5000:30000", "--count", "1")
    assert ([m["branch"] for m in few["modes"][0]], few["modes_in_band"]) == ([7, 8], [12])  # what grows comes on top
    moved = run(folder, "modes", "--band", "8500:8600", "--mu", "0:0.1:3")
    # At each μ what lies in the band there, of branches that pass through it.
    assert [[m["branch"] for m in row] for row in moved["modes"]] == [[], [8], []]
    said = stridor("modes", "two-beams.toml", "--band", "100:5000", cwd=folder).stdout
    assert "all 6 modes from 100 to 5000 Hz listed; 0 unstable" in " ".join(said.split())
    assert "1 more unstable outside of it, up to 40000 Hz" in " ".join(said.split())


def test_a_band_without_modes_is_told_as_one(folder: Path) -> None:
    said = stridor("modes", "two-beams.toml", "--max-frequency", "3", cwd=folder).stdout
    assert "no mode up to 3 Hz at μ = 0.1" in " ".join(said.split())
    assert "0 modes" not in said.splitlines()[-2]


def test_bands_of_onsets_shapes_and_sensitivities(folder: Path) -> None:
    found = run(folder, "onsets", "--band", "1000:9000", "--range", "0:0.9")
    assert [round(o["frequency_hz"]) for o in found["onsets"]] == [8635, 3620]
    assert (found["band_hz"], found["onsets_outside_band"]) == ([1000.0, 9000.0], 2)
    shapes = run(folder, "shapes", "--band", "1000:8000")
    assert ([m["branch"] for m in shapes["modes"]], shapes["band_hz"]) == ([4], [1000.0, 8000.0])  # the slowest to decay
    assert run(folder, "sensitivities", "--band", "8000:9000")["modes"][0]["branch"] == 8
    none = run(folder, "sensitivities", "--band", "100:8000")
    assert none["modes"] == []
    assert none["warnings"][0].startswith("no mode from 100 to 8000 Hz is unstable at μ = 0.1")


def test_options_stand_for_settings_of_the_case(folder: Path) -> None:
    case = st.load(folder / "two-beams.toml", ["modal.damped=false", "modal.max_frequency_hz=9000.0"])
    expected = st.sensitivities(case, mu=0.2).to_json()
    found = run(folder, "sensitivities", "--undamped", "--max-frequency", "9000", "--source", "receptance", "--mu", "0.2")
    assert [m["branch"] for m in found["modes"]] == [m["branch"] for m in expected["modes"]]
    assert found["modes"][0]["growth_rate"] == pytest.approx(expected["modes"][0]["growth_rate"], rel=1e-12)
    many = run(folder, "sensitivities", "--branch", "7", "--branch", "9")
    assert [m["branch"] for m in many["modes"]] == [7, 9]


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("modes --band 100:50", "--band: '100:50' – low:high in Hz, 0 ≤ low < high ≤ 40000, the highest frequency looked"),
        ("modes --band 100:50000", "--band: '100:50000' – low:high in Hz, 0 ≤ low < high ≤ 40000, the highest"),
        ("modes --band abc", "--band: 'abc' – two numbers, low:high"),
        ("shapes --band 1:9 --branch 5", "--band: '1:9' – goes without --branch, which says already which modes"),
        ("shapes --mu 0.1,0.2", "--mu: '0.1,0.2' – one friction coefficient for shapes; modes and compare take several"),
        ("steady --mu=-1", "--mu: '-1' – a number ≥ 0"),
        ("compare --range 1:0", "--range: '1:0' – low:high, two friction coefficients 0 ≤ low < high"),
        ("modes --max-frequency nan", "--max-frequency: nan – a highest frequency is a finite number > 0 [Hz]"),
        ("ensemble --mu 0.1,0.2 --swept load", "--swept: 'load' – goes with --sweep up|down|both"),
        ("modes --source ''", "--source: "),
        ("modes --source x", "--source: 'x' – must be "),
        ("modes --set modal.source='x'", "modal.source: 'x' – must be "),
        ("modes --solver x", "--solver: 'x' – must be "),
        ("modes --mu 0:1:1e9", "--mu: '0:1:1e9' – start:stop:count, where count is a whole number from 1 to 1000000"),
        ("steady --mu 0.1:0.2", "--mu: '0.1:0.2' – one friction coefficient for steady; modes and compare take several"),
        ("countermeasures --percent 0", "--percent: 0.0 – a size of change between 0 and 100 %"),
        ("reduce --bound 2", "--bound: 2.0 – "),
        ("damping-map --x bodies.beam1.damping.mass --y bodies.beam2.damping.mass --x-range 1:2 --y-range 1:2 --points 1", "--points: 1 – "),
        ("damping-map --x bodies.beam1.damping.mass --y bodies.beam2.damping.mass --x-range 1:2 --y-range 1:2 --method x", "--method: 'x' – "),
        ("boundary --x mu --y mu --x-range 1:2 --y-range 1:2", "--y: 'mu' – the same number as x; give another one"),
        ("boundary --x mu --y materials.steel.density --x-range 1:2 --y-range 1:2 --lines 1", "--lines: 1 – "),
        ("boundary --x mu --y materials.steel.density --x-range 1:2 --y-range 1:2 --tolerance 1", "--tolerance: 1.0 – "),
        ("ensemble --window nan", "--window: nan – the share of the last phase that is looked at, above 0 and at most 1"),
        ("ensemble --observable x", "--observable: 'x' – "),
        ("compare --only x", "--only: 'x' – "),
        ("cycles --seconds 0", "--seconds: 0.0 – a time > 0 [s]"),
        ("countermeasures --branch 5 --branch 6", "--branch: '5, 6' – one mode; without --branch all unstable ones"),
        ("countermeasures --mu 0.1 --branch 1", "--branch: 1 – not an unstable branch, 8; without one all of these together"),
        ("sensitivities --mu 0.1 --branch 0 --branch 9", "--branch: [0] – numbers of branches from 1 to "),
        ("onsets --along contacts.A.stiffness --between 1e9:1e11 --band 1:9", "--band: is not for onsets along "),
    ],
)
def test_wrong_values_are_told_by_the_name_of_the_option(folder: Path, words: str, message: str) -> None:
    verb, *more = words.replace("''", "\0").split()
    done = stridor(verb, "two-beams.toml", *(w.replace("\0", "") for w in more), "--quiet", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"stridor: {message}")
    assert done.stderr.count("\n") == 1


def test_a_verb_goes_by_the_name_that_is_typed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []
    beating = arguments.beating
    monkeypatch.setattr(arguments, "beating", lambda **options: (seen.append(options["verb"]), beating(**options))[1])
    ranges = ("--x", "a", "--y", "b", "--x-range", "1:2", "--y-range", "1:2")
    assert stridor("damping-map", "none.toml", *ranges, cwd=folder).returncode == 2
    assert seen == ["damping-map"]


@pytest.mark.bad_input
@pytest.mark.parametrize(
    "words", ["modes --mu abc", "modes --band 1:0", "shapes --band 1:0", "onsets --band 1:0", "onsets --range 1:0",
              "sensitivities --mu 0:1:2", "countermeasures --branch 1 --branch 2", "steady --mu abc"]
)  # fmt: skip
def test_wrong_values_are_told_before_a_model_is_built(folder: Path, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def build(*_: object) -> None:
        raise AssertionError("built a model before it looked at the options")

    monkeypatch.setattr("stridor.study.workspace.build_system", build)
    verb, *more = words.split()
    # A setting of which the case alone does not say whether it has an effect.
    done = stridor(verb, "two-beams.toml", *more, "--set", "modal.friction_damping=true", cwd=folder)
    assert done.returncode == 2, done.stderr


@pytest.mark.parametrize("verb", sorted(set(VERBS) - {"cycles", "app"}))
def test_what_options_take_has_a_name(verb: str) -> None:
    nameless = [n for n, (kind, told, _) in VERBS[verb].items() if "bool" not in str(kind) and not told.metavar]
    assert nameless == []


@pytest.mark.parametrize("name", ["--mu", "--out", "--x", "--y", "--method"])
def test_help_speaks_of_no_verb_that_it_does_not_stand_with(name: str) -> None:
    told = next(own[name][1].help for own in VERBS.values() if name in own)
    assert not set(re.findall(r"[a-z-]+", told)) & set(VERBS)


@pytest.mark.parametrize("verb", READING)
def test_what_was_computed_before_has_no_case_to_change(verb: str) -> None:
    assert {"--set", "--solver"} & set(VERBS[verb]) == set()
    assert "--out" in VERBS[verb]


def test_bands_in_python(folder: Path) -> None:
    work = st.Workspace(st.load(folder / "two-beams.toml"))
    modes = st.modes(work, 0.1, band_hz=(5000.0, 9000.0))
    assert modes.branch.tolist() == [7, 8, 9, 10]
    assert modes.total.tolist() == [4]
    assert np.array_equal(modes.residual, st.modes(work, 0.1, count=19).residual[:, 6:10])
    with pytest.raises(CaseError, match=r"band_hz: .*goes before the choice of the lowest modes"):
        st.modes(work, 0.1, count=3).between(100.0, 200.0)
    with pytest.raises(CaseError, match="band_hz: '0:50000'"):
        st.onsets(work, band_hz=(0.0, 5e4))
