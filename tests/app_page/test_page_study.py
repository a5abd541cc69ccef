"""A study on the page: its samples on the map, its case on the bench."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from browsing import PATIENT, WITH_BROWSER, expect, page_at, serving, wait

import stridor as st
from benches import paper_case
from program import stridor
from stridor.app.page.study_rows import study_at

MASS = "bodies.beam1.damping.mass"
SMALL = {"bodies.beam1.elements": 4, "bodies.beam2.elements": 8, "modal.max_frequency_hz": 20e3}


@pytest.fixture(scope="module", params=["modes", "onsets"])
def store(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    parameters = {MASS: {"range": (1.0, 90.0)}, "materials.steel.density": {"range": (7700.0, 7900.0)}}
    if request.param == "modes":
        parameters = {"mu": {"range": (0.0, 0.5)}, **parameters}
    study = st.Study(
        case=paper_case().with_(SMALL), compute=request.param, parameters=parameters,
        sampling={"method": "sobol", "samples": 8},
    )  # fmt: skip
    folder = tmp_path_factory.mktemp(request.param) / "scatter.out"
    st.run_study(study, folder, workers=1)
    return folder


def test_samples_are_those_of_the_store(store: Path) -> None:
    source, rows = study_at(store)
    result = st.open_study(store)
    assert list(rows["numbers"]) == list(result.parameters)
    for path, values in rows["numbers"].items():
        assert values == result.data[path].values.tolist()
    assert rows["grows"] == result.unstable.tolist()
    assert len(rows["words"]) == 8
    assert source.name == "scatter.out"
    assert st.loads(source.text).with_(SMALL) == paper_case().with_(SMALL)
    json.dumps(rows, allow_nan=False)


@pytest.mark.bad_input
def test_what_is_no_study_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("nicegui", reason="the extra app is not installed")
    told = stridor("app", str(tmp_path), "--no-browser", cwd=tmp_path)
    assert told.returncode == 2
    assert "Traceback" not in told.stderr
    (tmp_path / "case.toml").write_text(paper_case().to_toml(), encoding="utf-8")
    with pytest.raises(st.CaseError):
        study_at(tmp_path / "nowhere")


# Of a study of onsets other words stand beside the same numbers: those of its store are looked at above.
@WITH_BROWSER
@pytest.mark.parametrize("store", ["modes", pytest.param("onsets", marks=pytest.mark.slow)], indirect=True)
def test_a_click_on_a_sample_takes_the_bench_there(browser, store: Path) -> None:
    pytest.importorskip("nicegui", reason="the extra app is not installed")
    with serving(str(store)) as (_, address), page_at(browser, address) as page:
        wait(page, "stridorMap.page.samples !== null && getElement(stridorMap.page.chart).chart.getOption().series?.length > 2")
        _, rows = study_at(store)
        (first, xs), (second, ys) = list(rows["numbers"].items())[:2]
        page.wait_for_timeout(500)
        chart = "getElement(stridorMap.page.chart).chart"
        k = int(np.argsort(xs)[4])
        x, y = page.evaluate(f"{chart}.convertToPixel({{gridIndex: 0}}, [{xs[k]}, {ys[k]}])")
        page.locator(".st-map-chart").click(position={"x": x, "y": y}, timeout=PATIENT)
        wait(page, f"stridor.state.values['{first}'] === {xs[k]} && stridor.state.values['{second}'] === {ys[k]}")
        expect(page.locator("#st-map-said")).to_contain_text(rows["words"][k])
        for path, values in rows["numbers"].items():
            assert page.evaluate(f"stridor.state.values['{path}']") == values[k]
        page.get_by_role("button", name="Undo").click()  # once, of all numbers
        wait(page, f"stridor.state.values['{first}'] !== {xs[k]} && stridor.state.values['{second}'] !== {ys[k]}")
        expect(page.get_by_role("button", name="Undo")).to_be_disabled()
