"""Each page of the documentation says what is so: its commands run, what it shows is printed, what it names exists."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from pages import PIECE, ROOT, Page, alike, assert_shown

DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.glob("*.md"), ROOT / "README.md"])


def blocks(page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return [p["language"] for p in PIECE.finditer(text) if p["note"] is None and not p["language"].startswith("{")]


OWN = {"tutorial-matrices"}  # followed by tests/unit/test_tutorial_matrices.py
FOLLOWED = [page for page in PAGES if blocks(page) and page.stem not in OWN]


def follow(page: Path, folder: Path, *, slow: bool) -> Page:
    files = DOCS / page.stem
    if files.is_dir():
        shutil.copytree(files, folder, dirs_exist_ok=True)
    return Page(page, folder, slow).follow()


# Weekly: each takes seconds. The README and the tutorial are followed in each run, and so are all short pages.
LONG = {
    "api", "boundaries", "ensembles", "how-to", "limit-cycles", "other-programs", "pitfalls", "studies",
    "tutorial-solids",
}  # fmt: skip
EACH_RUN = [pytest.param(page, marks=pytest.mark.slow) if page.stem in LONG else page for page in FOLLOWED]


@pytest.mark.parametrize("page", EACH_RUN, ids=lambda page: page.stem)
def test_page_can_be_followed(page: Path, tmp_path: Path) -> None:
    follow(page, tmp_path, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [p for p in FOLLOWED if "<!-- slow" in p.read_text(encoding="utf-8")], ids=lambda page: page.stem
)
def test_page_can_be_followed_in_whole(page: Path, tmp_path: Path) -> None:
    follow(page, tmp_path, slow=True)


@pytest.mark.parametrize("page", [p for p in PAGES if p.parent == DOCS], ids=lambda page: page.stem)
def test_page_opens_with_a_picture(page: Path) -> None:
    opening = re.match(r"(\([\w-]+\)=\n)?# [^\n]+\n\n```\{image\} (images/\S+)\n:alt: \S", page.read_text(encoding="utf-8"))
    assert opening
    assert 5_000 < (DOCS / opening[2]).stat().st_size < 150_000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_that_a_page_names_exist(page: Path) -> None:
    named = re.findall(
        r"`(?:python )?((?:tests|benchmarks|examples|src)/[\w./-]+\.\w+)", page.read_text(encoding="utf-8")
    )
    gone = [name for name in named if (ROOT / name.partition("/")[0]).is_dir() and not (ROOT / name).exists()]
    assert not gone


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("```\nstridor new two-beams\n```\n```\nmake demo\n```\n", "no note says why it is not run"),
        ("<!-- not run: no -->\n```\nstridor modes a.toml --nonsense 3\n```\n", "No such option"),
        ("<!-- slow -->\n```\nstridor dance a.toml\n```\n", "no such verb"),
        ("```\n$ stridor new two-beams\nwritten: three-beams.toml\n```\n", "not printed"),
        ("<!-- first: x = 2.0 -->\n```python\nx + 1  # → 4\n```\n", "not printed"),
        ("```python\nx = 3\nx + 1\n# → 5\n```\n", "not printed"),
        ("```python\nx = 3  # → 3\n```\n", "no expression shows 3"),
        ("<!-- holds: 1 == 2 -->\n", "1 == 2"),
        ("```toml\n[supports.a]\nat = 'b.c'\nfixd = ['x']\n```\n", "fixd"),
        ("```\nstridor check nothing.toml\n```\n", "nothing.toml"),
        ("<!-- first: stridor new two-beams -->\n```\nstridor check two-beams.toml\n```\nIt has 362 freedoms.\n<!-- held: 362 -->\n", "362 is not in"),
        ("<!-- later: no -->\n```python\n1\n```\n", "unknown note"),
        ("<!-- not run: no block follows -->\n", "a note without a block"),
    ],
)  # fmt: skip
def test_a_page_that_is_wrong_is_noticed(text: str, message: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    with pytest.raises((AssertionError, pytest.fail.Exception), match=re.escape(message)):
        Page(page, tmp_path, slow=False).follow()


def test_numbers_are_compared_to_the_digits_shown() -> None:
    assert alike("0.0767", "0.07670001")
    assert not alike("0.0767", "0.0769")
    assert alike("2.0e-16", "7e-17")
    assert not alike("8635", "8636.1")
    assert not alike("8635", "8635.6", half=True)
    assert_shown(["a 1.0", "…", "c"], "title\na 1.01\nb\nc\n")
    with pytest.raises(AssertionError, match="not printed: c"):
        assert_shown(["a", "c"], "a\nb\nc\n")
