"""What the verbs compute as CSV files: the same names of columns everywhere, the numbers of the JSON document."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path

import pytest

import stridor as st
from documented import RESULTS, assert_told
from mode_coupling import mode_coupling
from program import stridor
from stridor.case import template_text
from stridor.io import atomic
from undrawn import nothing_drawn

FEW = [
    "bodies.beam1.elements=6", "bodies.beam2.elements=18", "modal.sweep_points=3", "modal.max_frequency_hz=12e3",
    "modal.friction_range=[0.0, 0.2]", "phases.press.duration=2e-4", "phases.slide.duration=4e-4",
]  # fmt: skip
DAMPINGS = ("bodies.beam1.damping.mass", "bodies.beam2.damping.mass")
MAP = ["--x", DAMPINGS[0], "--y", DAMPINGS[1], "--x-range", "10:50", "--y-range", "10:50", "--points", "2"]
BOUNDARY = ["--x", DAMPINGS[0], "--x-range", "10:50", "--y", "mu", "--y-range", "0:0.2", "--lines", "2"]
REDUCE = ["--box", "mu=0:0.3", "--at", "mu=0.1,0.2", "--onsets", "mu"]
ALONG = ["--along", "bodies.beam1.thickness", "--between", "0.0014:0.0015"]
# Verbs with words of their own, and the files that they write.
VERBS = {
    "modes": (["--mu", "0.1,0.2"], ["modes.csv"]),
    "onsets": ([], ["onsets.csv"]),
    "onsets along": (ALONG, ["onsets-along.csv"]),
    "sensitivities": (["--mu", "0.2", "--parameter", "mu", "--parameter", DAMPINGS[0]], ["sensitivities.csv"]),
    "countermeasures": (["--mu", "0.2", "--verify", "1"], ["countermeasures.csv"]),
    "damping-map": (MAP, ["damping_map.csv"]),
    "boundary": (BOUNDARY, ["boundary.csv"]),
    "cycles": (["--mu", "1.0"], ["cycles.csv"]),
    "ensemble": (["--mu", "0.05,0.2", "--speed", "1,2", "--set", "temporal.record_every=5"], ["ensemble.csv"]),
    "reduce": (REDUCE, ["reduced.csv", "reduced-onsets.csv"]),
}


def documented() -> dict[str, list[str]]:
    """Columns by file, as docs/results.md has them."""
    text = RESULTS.read_text(encoding="utf-8")
    part = text.partition("## CSV files")[2].partition("\n## ")[0]
    found: dict[str, list[str]] = {}
    for line in part.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 3 and ".csv" in cells[0]:
            # What stands in brackets explains.
            columns = re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)", "", cells[2]))
            found |= dict.fromkeys(re.findall(r"`([\w-]+\.csv)`", cells[0]), columns)
    return found


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("csv")
    (made / "case.toml").write_text(st.loads(template_text("two-beams"), FEW).text, encoding="utf-8")
    (made / "rub.toml").write_text(mode_coupling(0.02, 0.1).text, encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def documents(folder: Path) -> dict[str, dict]:
    found: dict[str, dict] = {}
    for name, (words, files) in VERBS.items():
        case = "rub.toml" if name == "cycles" else "case.toml"
        with nothing_drawn():
            done = stridor(name.split()[0], case, *words, "--json", "--out", "case.out", cwd=folder)
        assert done.returncode == 0, done.stderr
        for file in files:
            assert f"written: case.out/{file}" in done.stderr or file in str(json.loads(done.stdout).get("files"))
        found[name] = json.loads(done.stdout)
        assert_told(name.split()[0], done.stdout)
    return found


@pytest.mark.parametrize("verb", VERBS)
def test_columns_are_those_of_the_documentation(verb: str, folder: Path, documents: dict[str, dict]) -> None:
    assert documents[verb]
    own = {"damping_map.csv": list(DAMPINGS), "boundary.csv": [DAMPINGS[0], "mu"], "reduced.csv": ["mu"]}
    by_contact = {"ensemble.csv": ["A.stick", "A.slip", "A.separation"]}
    for file in VERBS[verb][1]:
        rows = read(folder / "case.out" / file)
        assert rows
        assert list(rows[0]) == own.get(file, []) + documented()[file] + by_contact.get(file, [])
        for row in rows:
            for name, cell in row.items():
                if name.endswith(("_hz", "_1_s", "_percent", "residual")) and cell:
                    assert math.isfinite(float(cell)), (file, name)
                    assert cell == repr(float(cell))
            if "damping_percent" in row:
                growth, turns = float(row["growth_1_s"]), 2 * math.pi * float(row["frequency_hz"])
                assert float(row["damping_percent"]) == pytest.approx(-100 * growth / math.hypot(growth, turns))
                assert (row["unstable"] == "1") == (growth > 0)


def test_numbers_are_those_of_the_documents(folder: Path, documents: dict[str, dict]) -> None:
    tables = {file: read(folder / "case.out" / file) for _, files in VERBS.values() for file in files}
    modes = [(mu, m) for mu, own in zip(*(documents["modes"][k] for k in ("mu", "modes")), strict=True) for m in own]
    told = [(float(r["mu"]), int(r["branch"]), float(r["frequency_hz"]), float(r["growth_1_s"])) for r in tables["modes.csv"]]
    assert told == [(mu, m["branch"], m["frequency_hz"], m["growth_rate"]) for mu, m in modes]
    for verb, file, value in (("onsets", "onsets.csv", "mu"), ("onsets along", "onsets-along.csv", "value")):
        onsets = documents[verb]["onsets"]
        assert [float(r["value"]) for r in tables[file]] == [o[value] for o in onsets]
        assert [float(r["frequency_hz"]) for r in tables[file]] == [o["frequency_hz"] for o in onsets]
    assert {r["parameter"] for r in tables["onsets.csv"]} == {"mu"}
    kept = st.open(folder / "case.out" / "sensitivities.nc")
    (sensitive, *_), numbers = documents["sensitivities"]["modes"], tables["sensitivities.csv"]
    assert [r["parameter"] for r in numbers[:2]] == ["mu", DAMPINGS[0]]
    assert float(numbers[1]["growth_per_percent_1_s"]) == sensitive["parameters"][1]["growth_per_percent"]
    assert kept["growth_per_percent"].values[1, 0] == sensitive["parameters"][1]["growth_per_percent"]
    measures = documents["countermeasures"]["measures"]
    assert [r["name"] for r in tables["countermeasures.csv"]] == [m["name"] for m in measures]
    assert float(tables["countermeasures.csv"][0]["verified_removed_1_s"]) == measures[0]["verified"]["removed"]
    found = documents["damping-map"]["onset_mu"]
    assert [float(r["mu"]) for r in tables["damping_map.csv"]] == [mu for row in found for mu in row]
    points = documents["reduce"]["modes"]
    assert [float(r["growth_1_s"]) for r in tables["reduced.csv"]] == [g for p in points for g in p["growth_rate"]]


def test_run_writes_them_beside_its_results(folder: Path) -> None:
    case = st.load(folder / "case.toml")
    files = [path.name for path in st.run(case, folder / "all", only=["modes", "onsets"], skip=["report"]).files]
    assert {"modes.nc", "modes.csv", "onsets.nc", "onsets.csv"} <= set(files)
    assert list(read(folder / "all" / "modes.csv")[0]) == documented()["modes.csv"]


def test_a_file_is_the_old_or_the_new_one(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stridor.io.csv_files import write_rows

    path = folder / "kept.csv"
    write_rows(path, ("a",), [(1.0,)])
    monkeypatch.setattr(atomic.Path, "replace", _full)
    with pytest.raises(st.AnalysisError, match="No space left on device"):
        write_rows(path, ("a",), [(2.0,)])
    monkeypatch.undo()
    assert path.read_text(encoding="utf-8") == "a\n1.0\n"
    assert not list(folder.glob(".kept*"))


def _full(*_: object) -> None:
    raise OSError(28, "No space left on device")
