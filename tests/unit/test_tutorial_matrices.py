"""The tutorial on matrices, followed from its first line to its last: files written, commands run, numbers compared."""

from __future__ import annotations

import contextlib
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import stridor as st
from program import stridor
from rubbing_block import rubbing_block

DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHOWN = "$ "  # before a command whose output follows


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """The folder in which everything was done, and what each command printed."""
    folder = tmp_path_factory.mktemp("tutorial")
    for file in (DOCS / "tutorial-matrices").iterdir():
        shutil.copy(file, folder)
    printed: dict[str, str] = {}
    for language, text in BLOCK.findall((DOCS / "tutorial-matrices.md").read_text(encoding="utf-8")):
        if language == "toml":
            name = re.match(r"# (\S+\.toml)\n", text)
            assert name, f"which file is this?\n{text}"
            (folder / name[1]).write_text(text, encoding="utf-8")
        elif language == "python":
            with contextlib.chdir(folder):
                exec(compile(text, "tutorial-matrices.md", "exec"), {})
        else:
            for line in text.splitlines():
                command = line.removeprefix(SHOWN)
                if command.startswith("stridor "):
                    done = stridor(*shlex.split(command)[1:], cwd=folder)
                    assert done.returncode == 0, f"{command}\n{done.stderr}"
                    assert "note" not in done.stderr
                    printed[command] = done.stdout
                    if line != command:
                        _assert_shown(text.splitlines()[1:], done.stdout)
    return folder, printed


def _assert_shown(lines: list[str], output: str) -> None:
    """What is shown stands at the beginning of the output; of numbers below 1e-9 it is that they are."""
    for shown, printed in zip(lines, output.splitlines(), strict=False):
        words, own = shown.split(), printed.split()
        assert len(words) == len(own), (shown, printed)
        for word, mine in zip(words, own, strict=True):
            try:
                values = float(word), float(mine)
            except ValueError:
                assert word == mine
            else:
                assert values[0] == pytest.approx(values[1], rel=1e-3, abs=1e-9)


def test_every_command_is_run(followed: tuple[Path, dict[str, str]]) -> None:
    verbs = [command.split()[1] for command in followed[1]]
    assert verbs == ["new", "export", "matrices", "modes", "modes", "export", "onsets", "modes", "check", "onsets"]


def test_what_the_text_says(followed: tuple[Path, dict[str, str]]) -> None:
    _, printed = followed
    assert "K − Kᵀ has rank 2" in printed["stridor matrices brake.toml"]
    growing = [line.split() for line in printed["stridor modes brake.toml"].splitlines() if "  unstable" in line]
    assert [words[1] for words in growing] == ["8667.05"]
    whirling = printed["stridor modes rotor.toml --set parameters.Omega.value=100"]
    for frequency in (50 - 100 / (2 * np.pi), 50 + 100 / (2 * np.pi)):
        assert f"{frequency:.4f}" in whirling
    complete = " ".join((DOCS / "tutorial-matrices.md").read_text(encoding="utf-8").split())
    sentence = st.onsets(st.load(followed[0] / "squeal.toml")).completeness
    assert re.sub(r"\d+ unknowns", "", sentence) in re.sub(r"\d+ unknowns", "", complete)


def test_both_ways_give_the_same(followed: tuple[Path, dict[str, str]]) -> None:
    folder, _ = followed
    meshed = st.loads(rubbing_block("max_frequency_hz = 30e3"))
    pairs = [("two-beams.toml", "squeal.toml"), ("two-beams.toml", "squeal/matrices.toml"), (meshed, "caliper.toml")]
    for one, other in pairs:
        cases = [case if isinstance(case, st.Case) else st.load(folder / case) for case in (one, other)]
        own, imported = ([(o.mu, o.frequency_hz) for o in st.onsets(case).onsets] for case in cases)
        assert own
        assert np.array(imported) == pytest.approx(np.array(own), rel=1e-9)
