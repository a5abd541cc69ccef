"""The command line: what each verb prints where, exit codes, files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from program import stridor
from stridor.io import claims
from undrawn import nothing_drawn

# A coarse bench that runs in a second: few elements, large steps, short phases.
COARSE = [
    "bodies.beam1.elements=6",
    "bodies.beam2.elements=18",
    "temporal.step=4e-7",
    "temporal.record_every=5",
    "phases.press.duration=0.002",
    "phases.slide.duration=0.004",
]
SETS = [word for item in COARSE for word in ("--set", item)]


def process(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The program in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "stridor", *words],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    done = stridor("new", "two-beams", "--quiet", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    return tmp_path


def document(done: subprocess.CompletedProcess[str]) -> dict:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_an_ensemble_with_failed_members_says_so_in_its_exit_code(folder: Path) -> None:
    words = ["ensemble", "two-beams.toml", "--mu", "0.1", "--window", "1", *SETS, "--out", "out"]
    steady = [
        "--set", "temporal.initial=\"steady-sliding\"", "--set", "phases.press.velocities.clamp=1", "--set",
        "phases.press.ramp=0", "--set", "phases.press.duration=2e-4", "--set", "phases.slide.duration=2e-4",
    ]  # fmt: skip
    fine = stridor(*words, *steady, cwd=folder)
    assert fine.returncode == 0, fine.stderr
    pulled = stridor(*words, *steady, "--set", "loads.press.force=[0.0, 20.0]", cwd=folder)
    assert "failed, 1 of 1 members: " in pulled.stdout
    assert pulled.returncode == 3


def test_new_does_not_overwrite(folder: Path) -> None:
    again = stridor("new", "two-beams", cwd=folder)
    assert again.returncode == 2
    assert "two-beams.toml" in again.stderr
    assert stridor("new", "two-beams", "--force", cwd=folder).returncode == 0


def test_new_refuses_a_folder_that_cannot_be_written_as_the_other_verbs_do(folder: Path) -> None:
    told = [
        stridor(*words, "--out", "two-beams.toml/in", cwd=folder)
        for words in (("new", "pad-on-disc"), ("modes", "two-beams.toml"))
    ]
    assert [done.returncode for done in told] == [2, 2]
    assert told[0].stderr == told[1].stderr
    assert told[0].stderr.startswith("stridor: --out: 'two-beams.toml/in' – two-beams.toml is a file")


def test_new_lists_templates(tmp_path: Path) -> None:
    done = stridor("new", "three-beams", cwd=tmp_path)
    assert done.returncode == 2
    assert (
        done.stderr
        == "stridor: template: 'three-beams' – no such template; did you mean 'two-beams'? there are: pad-on-disc, two-beams\n"
    )


def test_new_takes_overrides(tmp_path: Path) -> None:
    words = ("new", "two-beams", "--quiet", "--set", "contacts.A.friction.coefficient=0.3")
    assert stridor(*words, cwd=tmp_path).returncode == 0
    assert st.load(tmp_path / "two-beams.toml").contacts["A"].friction.coefficient == 0.3
    wrong = stridor("new", "two-beams", "--force", "--set", "contacts.A.friction.coefficient=-1", cwd=tmp_path)
    assert wrong.returncode == 2
    assert st.load(tmp_path / "two-beams.toml").contacts["A"].friction.coefficient == 0.3


def test_check_says_the_model_in_words(folder: Path) -> None:
    done = stridor("check", "two-beams.toml", cwd=folder)
    assert done.returncode == 0
    said = " ".join(done.stdout.split())
    assert "361 free degrees of freedom" in said
    assert "95 % of the stability limit 2.116e-08 s (set by beam2)" in said
    data = document(stridor("check", "two-beams.toml", "--json", cwd=folder))
    assert data["degrees_of_freedom"] == 361
    assert data["contacts"]["A"]["normal_force"] == pytest.approx(20.0, rel=1e-9)


def test_modes_json_has_the_promised_keys(folder: Path) -> None:
    done = stridor("modes", "two-beams.toml", "--mu", "0:0.2:3", "--json", "--quiet", *SETS, cwd=folder)
    data = document(done)
    assert done.stderr == ""
    assert data["mu"] == [0.0, 0.1, 0.2]
    assert len(data["modes"]) == 3
    for modes in data["modes"]:
        frequencies = [m["frequency_hz"] for m in modes]
        assert frequencies == sorted(frequencies)
        keys = {"frequency_hz", "growth_rate", "damping_ratio", "unstable", "residual", "branch"}
        assert all(keys <= set(m) for m in modes)
        assert max(m["residual"] for m in modes) < 1e-8
    assert {m["branch"] for m in data["modes"][0]} == {m["branch"] for m in data["modes"][2]}
    assert (folder / "two-beams.out" / "modes.nc").exists()


def test_overrides_reach_the_model(folder: Path) -> None:
    words = ("modes", "two-beams.toml", "--json", "--quiet", *SETS)
    plain = document(stridor(*words, cwd=folder))
    other = document(stridor(*words, "--set", "contacts.A.friction.coefficient=0.3", cwd=folder))
    assert plain["mu"] == [0.1]
    assert other["mu"] == [0.3]


def test_onsets_json(folder: Path) -> None:
    data = document(stridor("onsets", "two-beams.toml", "--json", "--quiet", "--out", "there", cwd=folder))
    first = data["onsets"][0]
    assert first["mu"] == pytest.approx(0.076725, rel=1e-4)
    assert first["frequency_hz"] == pytest.approx(8635.43, rel=1e-5)
    assert (first["kind"], first["damped"], first["branches"]) == ("flutter", True, [8, 10])
    assert first["residual"] < 1e-12
    assert (folder / "there" / "onsets.nc").exists()


def test_simulate_from_event_to_event(folder: Path) -> None:
    short = ["--set", "phases.press.duration=2e-4", "--set", "phases.press.ramp=1e-4"]
    short += ["--set", "phases.slide.duration=2e-4", "--set", "bodies.beam1.elements=6", "--set", "bodies.beam2.elements=12"]
    done = stridor("simulate", "two-beams.toml", "--stepper", "exact", *short, "--out", "exact", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "exact path" in done.stdout
    assert st.open(folder / "exact" / "simulate.nc").path == "exact"
    done = stridor("simulate", "two-beams.toml", "--stepper", "implicit", *short, "--out", "parts", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "implicit path" in done.stdout
    assert st.open(folder / "parts" / "simulate.nc").path == "implicit"
    refused = stridor("simulate", "two-beams.toml", "--stepper", "exakt", "--out", "exact", cwd=folder)
    assert refused.returncode == 2
    assert "did you mean 'exact'?" in refused.stderr


def test_simulate_and_compare_json(folder: Path) -> None:
    done = stridor("simulate", "two-beams.toml", "--json", "--quiet", *SETS, cwd=folder)
    data = document(done)
    assert done.stderr == ""
    promised = {
        "dominant_frequency_hz",
        "growth_rate",
        "saturated",
        "contacts",
        "energy",
        "steps",
        "dt",
        "wall_seconds",
    }
    assert promised <= set(data)
    contact = data["contacts"]["A"]
    fractions = [contact[f"{status}_fraction"] for status in ("stick", "slip", "separation")]
    assert sum(fractions) == pytest.approx(1.0)
    assert contact["max_normal_force"] > 20
    assert contact["max_slip_speed"] > 0.02
    assert data["energy"]["error"] < 1e-9
    assert data["steps"] == 15_000
    done = stridor("compare", "two-beams.toml", "--no-critical", "--json", "--quiet", *SETS, cwd=folder)
    data = document(done)
    promised = {"mu", "modal", "temporal", "frequency_error", "growth_rate_error", "mac", "critical_mu_modal"}
    assert promised | {"critical_mu_temporal", "verdict"} <= set(data)
    assert data["critical_mu_temporal"] is None
    assert data["frequency_error"] < 0.01


def _heed_interrupts() -> None:
    """A shell that starts the tests in the background has interrupts ignored, and children inherit that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def interrupted_run(folder: Path, words: list[str], seconds: float) -> tuple[int, str]:
    """Start a long run, press Ctrl-C some seconds after it has claimed its folder; exit code and log."""
    command = [sys.executable, "-m", "stridor", "simulate", "two-beams.toml", *words]
    with subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=_heed_interrupts,
    ) as process:
        until = time.monotonic() + 60.0
        while not (folder / "two-beams.out" / claims.NAME).exists() and time.monotonic() < until:
            time.sleep(0.05)
        time.sleep(seconds)
        os.kill(process.pid, signal.SIGINT)
        _, log = process.communicate(timeout=120)
    return process.returncode, log


def test_interruption_keeps_what_was_computed_and_a_restart_ends_alike(folder: Path) -> None:
    long = [*SETS, "--set", "phases.slide.duration=40.0", "--set", "temporal.record_every=2000"]
    assert stridor("simulate", "two-beams.toml", "--quiet", "--out", "warm", *SETS, cwd=folder).returncode == 0
    path = folder / "two-beams.out" / "simulate.nc"
    # On a loaded machine Ctrl-C may come before the first step: then there is nothing to keep.
    for seconds in (1.0, 3.0, 10.0, 20.0):
        code, log = interrupted_run(folder, long, seconds)
        if path.exists():
            break
        assert code == 130
    assert code == 130, log
    assert "go on with --restart" in log
    part = st.open(path)
    assert part.interrupted
    assert 0 < part.steps < part.planned_steps
    short = [w.replace("=40.0", f"={(part.steps + 20_000) * 4e-7 - 0.002:.7f}") for w in long]
    done = stridor("simulate", "two-beams.toml", "--quiet", "--restart", str(path), "--out", "on", *short, cwd=folder)
    assert done.returncode == 0, done.stderr
    whole = stridor("simulate", "two-beams.toml", "--quiet", "--out", "whole", *short, cwd=folder)
    assert whole.returncode == 0, whole.stderr
    one, two = (st.open(folder / name / "simulate.nc") for name in ("on", "whole"))
    assert np.array_equal(one.normal_force, two.normal_force)
    assert np.array_equal(one.displacement, two.displacement)
    assert one.phases == two.phases


def test_run_writes_a_self_contained_report(folder: Path) -> None:
    sets = [
        *SETS,
        "--set",
        "modal.max_frequency_hz=20e3",
        "--set",
        "modal.sweep_points=7",
        "--set",
        "comparison.critical=false",
    ]
    with nothing_drawn():  # that pictures need nothing from elsewhere is tested of test_view_report's
        done = stridor("run", "two-beams.toml", "--json", *sets, cwd=folder)
    data = document(done)
    assert set(data) >= {"modes", "onsets", "simulate", "compare", "report", "verdict"}
    report = (folder / data["report"]).read_text(encoding="utf-8")
    assert "<html" in report
    assert 'src="http' not in report
    for name in ("modes", "onsets", "simulate", "compare"):
        assert (folder / "two-beams.out" / f"{name}.nc").exists()
    assert list((folder / "two-beams.out" / "figures").glob("*.png"))
    assert list((folder / "two-beams.out" / "figures").glob("*.svg"))
    assert not list((folder / "two-beams.out").glob(".*")), "a temporary file was left behind"


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("check", "none.toml"), 2, "stridor: none.toml: no such file"),
        (
            ("modes", "two-beams.toml", "--mu", "abc"),
            2,
            "stridor: --mu: 'abc' – a number, numbers with commas, or start:stop:count, each number ≥ 0",
        ),
        (
            ("modes", "two-beams.toml", "--mu", "-0.1"),
            2,
            "stridor: --mu: '-0.1' – a number, numbers with commas, or start:stop:count, each number ≥ 0",
        ),
        (
            ("modes", "two-beams.toml", "--mu", "0:1:0"),
            2,
            "stridor: --mu: '0:1:0' – start:stop:count, where count is a whole number from 1 to 1000000",
        ),
        (
            ("modes", "two-beams.toml", "--mu", "nan"),
            2,
            "stridor: --mu: 'nan' – a number, numbers with commas, or start:stop:count, each number ≥ 0",
        ),
        (("onsets", "two-beams.toml", "--range", "1"), 2, "stridor: --range: '1' – two numbers, low:high"),
        (
            ("onsets", "two-beams.toml", "--range", "1:0"),
            2,
            "stridor: --range: '1:0' – low:high, two friction coefficients 0 ≤ low < high",
        ),
        (
            ("simulate", "two-beams.toml", "--set", "temporal.step=3e-8"),
            2,
            'stridor: temporal.step: 3e-08 – the explicit scheme is unstable beyond 2.116e-08 s, set by beam2; take a smaller step, coarser elements or mass = "lumped"',
        ),
        (
            ("simulate", "two-beams.toml", "--restart", "two-beams.toml"),
            2,
            "stridor: file: 'two-beams.toml' – no results of stridor; give a results file written by stridor (netCDF-4/HDF5)",
        ),
        (
            ("simulate", "two-beams.toml", "--restart", "none.nc"),
            2,
            "stridor: --restart: 'none.nc' – no such file",
        ),
        (
            ("onsets", "two-beams.toml", "--set", "loads.press.force=[0.0, 20.0]"),
            1,
            "stridor: steady sliding has no equilibrium: body beam1 can move freely under the loads; fix a freedom of the loose body, or turn the load so that it presses the bodies together; that is at μ = 0",
        ),
        (("onsets", "two-beams.toml", "--set", "contacts.A.friction.coefficient=-0.1"), 2, None),
    ],
)
def test_bad_calls_give_one_line_and_no_traceback(
    folder: Path, words: tuple[str, ...], code: int, message: str | None
) -> None:
    done = stridor(*words, cwd=folder)
    assert done.returncode == code
    assert done.stdout == ""
    if message is not None:
        assert done.stderr == message + "\n"
    else:
        assert done.stderr.count("\n") == 1


def test_help_is_quick_and_complete(tmp_path: Path) -> None:
    done = process("--help", cwd=tmp_path)
    assert done.returncode == 0
    for verb in ("new", "check", "modes", "onsets", "simulate", "compare", "run"):
        assert verb in done.stdout


def test_import_stays_light() -> None:
    code = (
        "import sys, stridor; print(sorted(m for m in ('numba', 'matplotlib', 'scipy', 'xarray') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


MISSING = """
import sys
from stridor.app.entry import main
try:
    main()
except SystemExit as end:
    heavy = ("numba", "matplotlib", "numpy", "scipy", "xarray", "stridor.case.model")
    print(end.code, [m for m in heavy if m in sys.modules])
"""


@pytest.mark.parametrize("words", ["check", "onsets", "run", "matrices", "reduce --box mu=0:1"])
def test_a_file_that_is_not_there_is_told_before_anything_heavy_is_imported(tmp_path: Path, words: str) -> None:
    verb, *more = words.split()
    command = [sys.executable, "-c", MISSING, verb, "none.toml", *more]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "2 []\n"
    assert done.stderr == "stridor: none.toml: no such file\n"


def test_growth_from_steady_sliding_is_that_of_the_fastest_mode(folder: Path) -> None:
    sets = [
        *("--set", "temporal.initial=steady-sliding", "--set", "temporal.perturbation=2e-7"),
        *("--set", "phases=[{name='slide', duration=0.03}]", "--set", "contacts.A.stiffness=rigid"),
        *("--set", "temporal.record_every=10"),
    ]
    data = document(stridor("simulate", "two-beams.toml", "--json", "--quiet", *sets, cwd=folder))
    modes = document(stridor("modes", "two-beams.toml", "--json", "--quiet", *sets, cwd=folder))
    fastest = max(m["growth_rate"] for m in modes["modes"][0] if m["frequency_hz"] < 40e3)
    assert data["growth_rate"] == pytest.approx(fastest, rel=0.01)


@pytest.mark.slow
def test_weakening_friction_is_taken_at_its_slip_speed(folder: Path) -> None:
    law = 'contacts.A.friction={law="weakening",coefficient=0.05,static_coefficient=0.15,decay_speed=0.02}'
    data = document(stridor("modes", "two-beams.toml", "--json", "--quiet", "--set", law, cwd=folder))
    assert data["mu"][0] == pytest.approx(0.05 + 0.1 * np.exp(-1.0), rel=1e-12)
    found = document(
        stridor("onsets", "two-beams.toml", "--json", "--quiet", "--range", "0:0.1", "--set", law, cwd=folder)
    )
    assert all(onset["residual"] < 1e-8 for onset in found["onsets"])


@pytest.mark.slow
def test_two_contacts_with_different_friction_still_give_a_report(folder: Path) -> None:
    path = folder / "two-beams.toml"
    text = path.read_text(encoding="utf-8")
    beam = text[text.index("[bodies.beam1]") : text.index("[bodies.beam2]")]
    second = beam.replace("beam1", "beam3").replace("[0.1, 0.0]", "[0.05, 0.0]")
    more = (
        '[supports.guide2]\nat = "beam3.top"\nfixed = ["x", "rotation"]\n'
        '[loads.press2]\nat = "beam3.top"\nforce = [0.0, -20.0]\n'
        '[contacts.B]\nslave = "beam3.tip"\nmaster = "beam2"\nstiffness = 1e10\nfriction = { law = "coulomb", coefficient = 0.2 }\n'
    )
    path.write_text(text.replace("[bodies.beam2]", second + more + "[bodies.beam2]"), encoding="utf-8")
    sets = [*SETS, "--set", "bodies.beam3.elements=6", "--set", "comparison.critical=false"]
    sets += ["--set", "modal.max_frequency_hz=10e3", "--set", "modal.sweep_points=11"]
    done = stridor("run", "two-beams.toml", "--json", "--quiet", *sets, cwd=folder)
    assert (folder / document(done)["report"]).exists()
    alone = stridor("modes", "two-beams.toml", "--quiet", *sets, cwd=folder)
    # Without a μ each has its own; over μ there is one for all.
    assert alone.returncode == 0
    assert "each contact has its own friction coefficient (B 0.2, A 0.1); the μ that is named is the largest" in " ".join(alone.stdout.split())
    assert "unstable at μ = 0.2" in alone.stdout


@pytest.mark.bad_input
def test_an_overlap_is_refused_by_simulate_and_told_by_check(folder: Path) -> None:
    sets = ("--set", "bodies.beam1.start=[0.1,-0.0001]")
    done = stridor("simulate", "two-beams.toml", *sets, cwd=folder)
    assert done.returncode == 2
    assert done.stderr.startswith("stridor: contacts.A: 'overlap 0.0001 m' – bodies that touch or are apart")
    assert "overlap by 0.0001 m" in stridor("check", "two-beams.toml", "--json", *sets, cwd=folder).stdout


@pytest.mark.bad_input
@pytest.mark.parametrize("item", ["phases.slide.duration=1e9", "temporal.step=1e-30"])
def test_what_no_memory_holds_is_refused_with_numbers(folder: Path, item: str) -> None:
    done = stridor("simulate", "two-beams.toml", "--set", item, "--set", "temporal.record_every=1", cwd=folder)
    assert done.returncode == 2
    *warned, refused = done.stderr.splitlines()
    assert "GB of records" in refused
    told = " ".join(warned)
    assert told.count("warning: ") <= 1
    assert not told or (told.startswith("warning: ") and "unusual" in told)


def test_reduce_solves_anywhere_in_the_box_and_confirms_onsets(folder: Path) -> None:
    words = ["reduce", "two-beams.toml", "--box", "mu=0:0.3", "--box", "contact_stiffness=0.5:2", "--quiet"]
    found = document(stridor(*words, "--at", "mu=0.05,0.1", "--onsets", "mu", "--json", cwd=folder))
    assert [round(o["value"], 6) for o in found["onsets"]] == [0.076725, 0.137734, 0.167096]
    assert [p["point"]["mu"] for p in found["modes"]] == [0.05, 0.1]
    assert max(found["modes"][1]["growth_rate"]) == pytest.approx(637.328, abs=1e-2)
    shown = stridor(*words, "--at", "mu=0.1", "--out", "here", cwd=folder)
    assert "unstable" in shown.stdout
    assert (folder / "here" / "reduced.csv").read_text().count("\n") == 20  # heads and 19 modes


@pytest.mark.bad_input
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("--box mu", "--box: 'mu' – NAME=… such as mu=0:0.6"),
        ("--box mu=0.3:0.1", "--box mu: '0.3:0.1' – low:high, two finite numbers low < high"),
        ("--box mu=0:inf", "--box mu: '0:inf' – low:high, two finite numbers low < high"),
        ("--box mu=0:0.1 --at mu=abc", "--at mu: 'abc' – a number, numbers with commas, or start:stop:count"),
        ("--box mu=0:0.1 --at nu=1", "--at: 'nu' – no number of the model; there are: mu"),
        ("--box mu=0:0.1 --onsets nu", "--onsets: 'nu' – no number of the model; there are: mu"),
        ("--box mu=0:0.1 --at mu=0.1 --at mu=0.2", "--at: 'mu=0.2' – mu has values already"),
        (
            "--box mu=0:0.1 --at mu=-0.1",
            "--at mu: '-0.1' – a number, numbers with commas, or start:stop:count, each number ≥ 0",
        ),
    ],
)
def test_reduce_checks_what_it_is_asked_before_it_reduces(
    folder: Path, wrong: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reduced(*_: object, **__: object) -> None:
        raise AssertionError("reduced before it was checked what is asked of the model")

    monkeypatch.setattr("stridor.study.reduced.reduced_model", reduced)
    refused = stridor("reduce", "two-beams.toml", *wrong.split(), "--quiet", cwd=folder)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith(f"stridor: {message}")
    assert refused.stderr.count("\n") == 1


def test_reduce_says_that_it_keeps_damping(folder: Path) -> None:
    words = ("reduce", "two-beams.toml", "--box", "mu=0:0.1", "--set", "modal.damped=false")
    assert "note: modal.damped = false does not hold here" in stridor(*words, cwd=folder).stderr


@pytest.mark.slow
def test_what_a_change_would_do(folder: Path) -> None:
    found = document(
        stridor(
            "sensitivities", "two-beams.toml", "--mu", "0.1", "--parameter", "contacts.A.stiffness", "--json", "--quiet",
            cwd=folder,
        )
    )  # fmt: skip
    assert found
    assert (folder / "two-beams.out" / "sensitivities.png").exists()
    ranked = stridor("countermeasures", "two-beams.toml", "--mu", "0.1", "--verify", "0", "--quiet", cwd=folder)
    assert ranked.returncode == 0, ranked.stderr
    assert "raise materials.steel.density by 5 %" in ranked.stdout
    calm = stridor("countermeasures", "two-beams.toml", "--mu", "0.01", "--quiet", cwd=folder)
    assert calm.stdout == "no mode is unstable at μ = 0.01: there is nothing to remove\n"
