"""The report: one file that needs nothing else, whatever of its inputs is there."""

from __future__ import annotations

import base64
import re
from collections import defaultdict
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from test_view_plots import (
    agreement,
    balance,
    comparison,
    found_onsets,
    shape,
    small_system,
    spectra,
    sweep,
    trajectory,
)

from benches import paper_case
from stridor.errors import CaseError
from stridor.stages import heard
from stridor.temporal.signals import spectrogram
from stridor.view import FrictionCurve, NamedFrequencies, NamedShape, ReportInputs, plots, write_report
from stridor.view import report as report_module
from stridor.view.modal_tables import onset_tables
from stridor.view.page_parts import ReportFigure, tidy
from stridor.view.report import sections
from stridor.view.tables import quantity
from stridor.view.temporal_tables import energy_table
from stridor.view.words import verdict
from undrawn import nothing_drawn

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Reads a page, checks that tags are nested, collects what is referred to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.targets: list[str] = []
        self.images: list[dict] = []
        self.tags: list[str] = []
        self.words: list[str] = []
        self.attributes: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == [], "not closed"

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.tags.append(tag)
        if "id" in values:
            self.ids.append(values["id"])
        self.attributes += [name for name, _ in attrs]
        self.targets += [values[name] for name in ("src", "href", "data", "action") if values.get(name)]
        if tag == "img":
            self.images.append(values)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).replace("\u00a0", " ").split())


def full_inputs(**changes) -> ReportInputs:
    run, system = trajectory(), small_system()
    modes = sweep()
    values = {
        "case": paper_case(),
        "system": system,
        "mu": 0.1,
        "modes": modes,
        "undamped_sweep": sweep(damped=False),
        "damped_sweep": modes,
        "body_modes": {"beam1": NamedFrequencies(np.array([0.0, 491.9]), ("rigid", "F1"))},
        "coupled_hz": np.array([102.4, 489.3]),
        "undamped_onsets": found_onsets(damped=False),
        "damped_onsets": found_onsets(),
        "curve": FrictionCurve(np.linspace(0, 1, 20), np.linspace(1e3, 2e4, 20)),
        "trajectory": run,
        "energy": balance(run),
        "spectra": spectra(),
        "spectrogram": spectrogram(run.velocity[:, 0, 0], run.sampling, resolution_hz=500.0),
        "operating_shape": NamedShape(1000.0, shape()),
        "unstable_shape": NamedShape(8641.0, shape(1j), 637.0),
        "mac_by_body": {"beam1": 0.42, "beam2": 0.98},
        "agreement": agreement(comparison(mu=0.12)),
        "source_places": {"frequency-pair": "figure 3", "bodies": "table I"},
        "timings": {"modes": 0.5, "simulate": 4.0},
        "versions": {"stridor": "0.1"},
        "case_text": 'title = "x"  # <b>bold</b>',
        "created": "2026-01-01 12:00",
        "warnings": ("a warning",),
        "notes": ("a note",),
    }
    return ReportInputs(**{**values, **changes})


@pytest.fixture(scope="module")
def writing(tmp_path_factory) -> tuple[Path, list[str]]:
    """The report, and what was said while it was written."""
    told: list[str] = []
    with heard(lambda now: told.append("" if now is None else now.what)):
        return write_report(full_inputs(), tmp_path_factory.mktemp("out")), told


@pytest.fixture(scope="module")
def written(writing) -> Path:
    return writing[0]


@pytest.fixture(scope="module")
def page(written) -> Page:
    return Page(written.read_text(encoding="utf-8"))


def test_the_page_is_one_file_that_refers_to_nothing_outside(written, page):
    text = written.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert '<html lang="en">' in text
    assert page.targets
    assert all(target.startswith(("#", "data:image/svg+xml;base64,")) for target in page.targets)
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert not any(name.startswith("on") for name in page.attributes)
    assert not re.search(r"url\(|@import", text)
    assert written.stat().st_size < 8e6


def test_pictures_need_nothing_either(page):
    for image in page.images:
        drawing = base64.b64decode(image["src"].split(",", 1)[1]).decode("utf-8")
        outside = [target for target in re.findall(r'href="([^"]+)"', drawing) if not target.startswith(("#", "data:"))]
        assert outside == []
        assert "<text" not in drawing  # letters are outlines: no font is needed


def test_every_anchor_has_its_place_and_no_place_is_there_twice(page):
    assert len(set(page.ids)) == len(page.ids)
    wanted = {target[1:] for target in page.targets if target.startswith("#")}
    assert wanted <= set(page.ids)


def test_pictures_have_words_for_who_cannot_see_them(page):
    assert len(page.images) >= 18
    assert all(len(image["alt"]) > 20 for image in page.images)


def test_figures_lie_beside_the_page_as_png_and_svg(written, page):
    names = {path.stem for path in (written.parent / "figures").glob("*.png")}
    assert names == {path.stem for path in (written.parent / "figures").glob("*.svg")}
    assert len(names) == len(page.images)
    assert {f"figure-{name}" for name in names} <= set(page.ids)


def test_the_answer_comes_first(page):
    assert "It squeals at μ = 0.1, at 1000 Hz." in page.text
    assert "from μ = 0.0766 on, at 8635 Hz" in page.text
    assert "approach agree" in page.text
    assert page.ids.index("summary") < page.ids.index("model")


def test_places_in_the_source_and_its_notes_are_named(page):
    assert "In the source: figure 3." in page.text
    assert "(table I of the source)" in page.text
    for note in paper_case().reference.notes:
        assert note in page.text


def test_a_case_without_reference_mentions_no_source():
    inputs = full_inputs(case=paper_case().with_({"reference": None}), trajectory=None, spectra={}, spectrogram=None)
    text = Page(report_module.render(inputs, sections(inputs), defaultdict(str))).text  # without its pictures
    assert "source" not in text.replace('source = "auto"', "")  # but for the setting of that name
    assert "printed" not in text


@pytest.mark.parametrize(
    "inputs",
    [
        ReportInputs(paper_case()),
        ReportInputs(paper_case(), mu=0.1, modes=sweep()),
        ReportInputs(paper_case(), damped_sweep=sweep(top=0.05), damped_onsets=found_onsets()),
        ReportInputs(paper_case(), trajectory=trajectory()),
        ReportInputs(paper_case(), system=small_system(), mu=0.1, agreement=agreement()),
    ],
    ids=["case alone", "modes", "sweep and onsets", "run", "agreement"],
)
def test_what_is_missing_is_left_out(inputs, tmp_path):
    with nothing_drawn():
        page = Page(write_report(inputs, tmp_path).read_text(encoding="utf-8"))
    assert "None" not in page.text
    assert "nan" not in page.text.lower().split()
    listed = {target[1:] for target in page.targets if target.startswith("#")}
    assert listed <= set(page.ids)


def test_text_of_the_user_is_text(tmp_path):
    evil = '<script>alert("x")</script>'
    case = paper_case().with_({"title": evil, "reference.source": evil})
    inputs = ReportInputs(
        case, case_text="<b>bold</b>", notes=(evil,), warnings=(evil,), versions={evil: evil}, created=evil
    )
    page = Page(write_report(inputs, tmp_path).read_text(encoding="utf-8"))
    assert "script" not in page.tags
    assert "b" not in page.tags
    assert page.text.count("alert") >= 5
    assert "<b>bold</b>" in page.text


def test_equal_inputs_give_an_equal_page(tmp_path):
    inputs = ReportInputs(paper_case(), undamped_sweep=sweep(damped=False), undamped_onsets=found_onsets(damped=False))
    first = write_report(inputs, tmp_path / "a").read_bytes()
    assert write_report(inputs, tmp_path / "b").read_bytes() == first


def test_a_case_without_damping_is_nowhere_said_to_have_any():
    """Modes know what they were asked for, onsets whether there was any."""
    for both in (True, False):
        bare = {"undamped_sweep": None, "undamped_onsets": None, "undamped_pair": None}
        inputs = full_inputs(damped_onsets=found_onsets(damped=False), **({} if both else bare))
        chapter = next(c for c in sections(inputs) if c.name == "modal")
        said = " ".join([*chapter.paragraphs, *chapter.lines, *(f"{part.title} {part.caption}" for part in chapter.parts)]).lower()
        assert "without damping" in said
        assert "with structural damping" not in said
        assert not [text for text in (*chapter.paragraphs, *chapter.lines) if text.startswith("With damping")]
        assert "onsets, damped" not in said
        assert said.count("onsets, undamped") == 1
        names = [part.name for part in chapter.parts]
        assert len(names) == len(set(names))
    chapter = next(c for c in sections(full_inputs()) if c.name == "modal")
    assert {"Onsets, damped", "Onsets, undamped"} <= {part.title for part in chapter.parts}


def test_an_older_page_stays_when_writing_fails(tmp_path, monkeypatch):
    inputs = ReportInputs(paper_case())
    before = write_report(inputs, tmp_path).read_bytes()

    def broken(source, target):
        raise OSError("disk full")

    monkeypatch.setattr(report_module.os, "replace", broken)
    with pytest.raises(OSError, match="disk full"):
        write_report(full_inputs(), tmp_path)
    assert (tmp_path / "report.html").read_bytes() == before
    assert [path.name for path in tmp_path.rglob("*.part")] == []


def test_the_verdict_says_no_more_than_was_computed():
    assert verdict(ReportInputs(paper_case())).squeals is None
    calm = verdict(ReportInputs(paper_case(), mu=0.05, modes=sweep(top=0.05)))
    assert (calm.headline, calm.squeals, calm.agrees) == ("It does not squeal at μ = 0.05 up to 40 kHz", False, None)
    alone = verdict(ReportInputs(paper_case(), mu=0.2, modes=sweep()))
    assert alone.headline == "It may squeal at μ = 0.2, at 8635 Hz"  # in time nobody has looked


def test_what_goes_into_contacts_is_not_said_to_be_of_impacts_alone():
    inputs = full_inputs()
    rows = [row.cells[0] for row in energy_table(inputs.energy).rows]
    assert "into impacts and springs of contacts" in rows
    labels = plots.energy_plot(inputs.trajectory, inputs.energy).axes[0].get_legend().get_texts()
    assert "into impacts and contact springs" in [text.get_text() for text in labels]


def test_modes_over_friction_are_counted_where_some_mu_have_none() -> None:
    def drawn(modes) -> dict[str, tuple[str, str, str]]:
        inputs = full_inputs(undamped_sweep=None, undamped_onsets=None, damped_sweep=modes, agreement=None)
        parts = [p for chapter in sections(inputs) for p in chapter.parts if isinstance(p, ReportFigure)]
        return {p.name: (p.title, p.caption, p.alt) for p in parts}

    whole = sweep()
    title, caption, alt = drawn(whole)["frequencies-damped"]
    assert title == "The first 3 frequencies over friction, with structural damping"
    assert "A line that ends" not in caption
    nothing = np.zeros(len(whole.mu), dtype=bool)
    nothing[-10:] = True
    lam = whole.eigenvalues.copy()
    lam[nothing] = complex(np.nan, np.nan)
    assert drawn(replace(whole, eigenvalues=lam, unsolved=nothing))["frequencies-damped"] == (title, caption, alt)
    lam[:30, 1] = complex(np.nan, np.nan)
    title, caption, alt = drawn(replace(whole, eigenvalues=lam, unsolved=nothing))["frequencies-damped"]
    assert title == "Frequencies of 3 modes over friction, with structural damping"
    assert "A line that ends was not followed any further, as where other nodes touch." in caption
    assert alt.startswith("Frequencies of 3 modes over the friction coefficient")
    one = replace(whole, eigenvalues=lam[:, :1], branch=whole.branch[:1], residual=whole.residual[:, :1])
    title, _, alt = drawn(one)["frequencies-damped"]
    assert (title.split(",")[0], alt[:21]) == ("Frequencies of 1 mode over friction", "Frequencies of 1 mode")
    lam[:] = whole.eigenvalues + 1j * 1e9
    assert "frequencies-damped" not in drawn(replace(whole, eigenvalues=lam))


def test_chapters_without_content_are_not_there():
    names = [chapter.name for chapter in sections(ReportInputs(paper_case().with_({"reference": None})))]
    assert names == ["model"]


def test_numbers_keep_their_units_on_one_line():
    assert tidy("at μ = 0.1, 8641 Hz (2 s)") == "at μ\u00a0=\u00a00.1, 8641\u00a0Hz (2\u00a0s)"


def test_a_model_without_units_keeps_its_digits() -> None:
    """Frequencies and rates of a minimal model are tenths: neither the verdict nor a table may round them to nothing."""
    small, onsets = sweep(), found_onsets()
    modes = replace(small, eigenvalues=small.eigenvalues * 1e-5)
    first = replace(onsets.onsets[0], frequency_hz=0.15915494, mu=0.75)
    inputs = full_inputs(
        modes=modes, damped_sweep=modes, damped_onsets=replace(onsets, onsets=(first,)), undamped_onsets=None,
        undamped_sweep=None, trajectory=None, agreement=None,
    )  # fmt: skip
    said = verdict(inputs)
    frequencies = modes.frequency_hz[modes.at(0.1)][modes.unstable[modes.at(0.1)]]
    assert f"{frequencies[0]:.3g}" in said.headline + said.paragraph
    assert "0.159 Hz" in said.paragraph
    for text in (said.headline, said.paragraph):
        assert not re.search(r"\b0 Hz|\b0 1/s|−0\b|-0\b", text), text
    cells = [cell for table in onset_tables(inputs) for row in table.rows for cell in row.cells]
    assert "0.159" in cells
    assert quantity(-0.0) == "0.0"
    assert quantity(3199.75) == "3199.8"
    assert quantity(-2.5e-7) == "−2.50 · 10⁻⁷"


def test_what_is_drawn_is_told(writing):
    """Figures take seconds, in which nothing else would be said."""
    report, told = writing
    assert told[0] == "tables and figures of the page"
    assert told[-1] == ""
    drawn = {path.stem for path in (report.parent / "figures").glob("*.svg")}
    assert set(told[1:-1]) == {f"figure {name}, as SVG and PNG" for name in drawn}


def test_what_cannot_be_drawn_is_named_and_the_rest_is_there(tmp_path, monkeypatch):
    def broken(*_args, **_options):
        raise CaseError("cells", "wedge", "not a kind that can be drawn")

    monkeypatch.setattr(plots, "root_locus", broken)
    with nothing_drawn():
        page = Page(write_report(full_inputs(), tmp_path).read_text(encoding="utf-8"))
    assert "Not drawn: Root locus, CaseError: cells: 'wedge' – not a kind that can be drawn" in page.text
    names = {path.stem for path in (tmp_path / "figures").glob("*.svg")}
    assert {"model", "frequencies"} <= names
    assert "root-locus" not in names
    assert "figure-frequencies" in page.ids
    assert "figure-root-locus" not in page.ids
