"""Where compiled functions are kept, for which sources they count, and that they round the same in every process."""

from __future__ import annotations

import itertools
import json
import os
import pickle
import re
import shutil
import struct
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.compiler import Flags

import stridor
from stridor.contact import curve
from stridor.kernels import folder as folders
from stridor.kernels import njit
from stridor.kernels import turns as turns_module
from stridor.kernels.folder import ABOUT, Folder, kernel_folder
from stridor.kernels.sources import ABOVE, Sources, read_sources
from stridor.kernels.turns import Turn

PACKAGE = Path(stridor.__file__).parent

# A kernel whose own file stays as it is, while what it calls is changed below it.
CALLER = """
import numpy as np

from stridor.kernels import njit
from stridor.contact import multipliers

_solve_contact = njit(cache=True)(multipliers.solve_contact)


@njit(cache=True)
def slide(gap, slip, law):
    return _solve_contact(gap, slip, 1.0, 0.1, 2.0, law, False, 1e-6)


LAW = np.array([0.0, 0.3, 0.3, 0.0, 0.0])  # a constant coefficient, as `laws.packed` has it


if __name__ == "__main__":
    import caller

    normal, tangential, status = caller.slide(-1.0, 5.0, caller.LAW)
    print(repr(normal), repr(tangential), status, sum(caller.slide.stats.cache_hits.values()))
"""


def python(*words, environment=None, where=None, timeout=120):
    """What a fresh process prints, and its stderr."""
    unwanted = ("STRIDOR_CACHE_DIR", "NUMBA_CACHE_DIR", "PYTHONPATH")
    own = {k: v for k, v in os.environ.items() if k not in unwanted}
    done = subprocess.run(
        [sys.executable, *map(str, words)], env=own | (environment or {}), cwd=where, capture_output=True, text=True,
        timeout=timeout, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def installed(tmp_path: Path) -> Path:
    """A copy of the package, as an installer would put it there."""
    site = tmp_path / "site"
    shutil.copytree(PACKAGE, site / "stridor", ignore=shutil.ignore_patterns("__pycache__"))
    return site


# -- an upgrade
# ----------------------------------------------------------------------------------------------------------


def test_after_an_upgrade_nothing_is_computed_with_the_physics_of_the_version_before(tmp_path):
    """Only contact/multipliers.py changes, in place; the kernel that calls it is in an untouched file."""
    site, cache = installed(tmp_path), tmp_path / "cache"
    (tmp_path / "caller.py").write_text(CALLER)
    environment = {"PYTHONPATH": f"{site}{os.pathsep}{tmp_path}", "STRIDOR_CACHE_DIR": str(cache)}

    def result():
        printed, noted = python(tmp_path / "caller.py", environment=environment)
        assert noted == ""
        *numbers, loaded = printed.split()
        return [float(n) for n in numbers], int(loaded)

    # gap −1, slip 5: friction against the slip, N = 1/(1 − 0.1 μ), T = −μN.
    right = 1.0 / (1.0 - 0.3 * 0.1)
    first, loaded = result()
    assert (first[0], first[1], loaded) == (pytest.approx(right), pytest.approx(-0.3 * right), 0)
    again, loaded = result()
    assert (again, loaded) == (first, 1)

    left = site / "stridor" / "temporal" / "__pycache__"
    left.mkdir(exist_ok=True)
    (left / "stage._solve_contact-23.py311.nbi").write_bytes(b"of an old version")
    source = site / "stridor" / "contact" / "multipliers.py"
    text = source.read_text()
    changed = text.replace("tangential = sense * mu * normal", "tangential = sense * mu * normal * 0.5")
    assert changed != text
    source.write_text(changed)
    second, loaded = result()
    assert (second[0], second[1], loaded) == (pytest.approx(right), pytest.approx(-0.15 * right), 0)
    # What the old version left is gone, in the cache and beside the modules.
    assert len(list((cache / "kernels").iterdir())) == 1
    assert not list(site.rglob("*.nb[ic]"))


def test_every_kernel_is_made_by_our_njit():
    """One made by numba's would be kept beside its module, for good."""
    pattern = re.compile(r"^\s*(from numba import .*\b(njit|jit|vectorize|guvectorize)\b|import numba\b)", re.MULTILINE)
    found = [p for p in PACKAGE.rglob("*.py") if pattern.search(p.read_text(encoding="utf-8"))]
    assert {p.parent.name for p in found} == {"kernels"}
    using = [p for p in PACKAGE.rglob("*.py") if "import njit" in p.read_text(encoding="utf-8")]
    assert len(using) > 10
    assert not {p.relative_to(PACKAGE).parts[0] for p in using} & set(ABOVE)  # what the digest leaves out
    assert not list(PACKAGE.rglob("*.nb[ic]"))


def test_the_digest_sees_every_module_that_can_enter_a_kernel_and_nothing_else(tmp_path, monkeypatch):
    package = installed(tmp_path) / "stridor"
    monkeypatch.setattr(stridor, "__path__", [str(package)])
    first = read_sources()
    assert first is not None
    modules = {m for m in (p.relative_to(package) for p in package.rglob("*.py")) if m.parts[0] not in ABOVE}
    assert {Path(f).relative_to(package) for f in first.files} == modules
    (package / "temporal" / "__pycache__").mkdir()
    (package / "temporal" / "__pycache__" / "kernel.cpython-311.pyc").write_bytes(b"1")
    (package / "note.txt").write_text("2")
    (package / "view" / "report.py").write_text("")
    assert read_sources().digest == first.digest
    (package / "errors.py").write_text((package / "errors.py").read_text() + "\n")
    assert read_sources().digest != first.digest


@pytest.mark.slow
def test_the_digest_of_a_zip_archive_and_kernels_that_run_from_it(tmp_path):
    archive = tmp_path / "stridor.zip"
    shutil.make_archive(str(archive.with_suffix("")), "zip", PACKAGE.parent, "stridor")
    environment = {"PYTHONPATH": str(archive), "STRIDOR_CACHE_DIR": str(tmp_path / "cache")}
    script = (
        "from stridor.contact.surface import spline_weights; import numpy as np; from stridor.contact import curve; "
        "z = np.zeros(4); curve._spline_weights(0, 0.5, np.ones(3), z, np.zeros(4)); "
        "print(z.sum(), sum(curve._spline_weights.stats.cache_hits.values()))"
    )
    assert python("-c", script, environment=environment)[0].split() == ["1.0", "0"]
    assert python("-c", script, environment=environment)[0].split() == ["1.0", "1"]


def test_sources_that_change_below_a_running_process_are_not_mixed_with_those_it_has_loaded(tmp_path, caplog):
    caplog.set_level("WARNING", "stridor")  # a quiet command may have run in this process
    source = tmp_path / "module.py"
    source.write_text("1")
    time.sleep(0.05)  # clocks of file systems tick more slowly
    folder = Folder(str(tmp_path / "kept"), Sources(str(tmp_path), (str(source),), "0"), time.time_ns())
    assert folder.valid()
    time.sleep(0.05)
    source.write_text("2")
    folder._checked -= 10.0  # the last look was a while ago
    assert not folder.valid()
    assert not folder.valid()
    assert [r.message.split(";")[0] for r in caplog.records] == [
        "note: the sources of stridor have changed since this process began"
    ]


# -- which folders are removed
# ----------------------------------------------------------------------------------------------------------


def kept(top: Path, name: str, *, place: str, sources: str, days: float = 0.0, program: str = "stridor") -> Path:
    made = top / name
    made.mkdir(parents=True)
    (made / ABOUT).write_text(json.dumps({"program": program, "place": place, "sources": sources}))
    (made / "temporal.steppers.modal.kernel.run_modal-134-b516bdc7.py311.nbi").write_bytes(b"1")
    (made / "temporal.steppers.modal.kernel.run_modal-134-b516bdc7.py311.0123456789abcdef.nbc").write_bytes(b"2")
    then = time.time() - days * 86400.0
    os.utime(made / ABOUT, (then, then))
    return made


def named(k: int) -> str:
    return f"{k:024x}-{k:012x}"


def test_old_folders_are_removed_and_nothing_else(tmp_path):
    ours = Sources("/here/stridor", (), "new")
    present = kept(tmp_path, named(0), place="/here/stridor", sources="new")
    old = kept(tmp_path, named(1), place="/here/stridor", sources="old")
    same_for_another_processor = kept(tmp_path, named(2), place="/here/stridor", sources="new", days=3.0)
    another = kept(tmp_path, named(3), place="/there/stridor", sources="old", days=3.0)
    forgotten = kept(tmp_path, named(4), place="/there/stridor", sources="old", days=40.0)
    running = kept(tmp_path, named(5), place="/here/stridor", sources="old", days=40.0)
    strange = kept(tmp_path, "results", place="/here/stridor", sources="old", days=40.0)
    unmarked = kept(tmp_path, named(6), place="/here/stridor", sources="old", days=40.0)
    (unmarked / ABOUT).unlink()
    foreign = kept(tmp_path, named(7), place="/here/stridor", sources="old", days=40.0, program="another")
    used = kept(tmp_path, named(8), place="/here/stridor", sources="old", days=40.0)
    (used / "thesis.txt").write_text("mine")
    (tmp_path / named(9)).symlink_to(strange)
    holder = Folder(str(running), Sources("/here/stridor", (), "old"), 0)
    holder._lock = folders._held(str(running / ABOUT), Sources("/here/stridor", (), "old"))
    os.utime(running / ABOUT, (0, 0))

    folders._tidy(tmp_path, present.name, ours, fresh=False)
    assert not old.exists()
    assert not forgotten.exists()
    for folder in (present, same_for_another_processor, another, running, strange, unmarked, foreign):
        assert len([p for p in folder.iterdir() if p.suffix in (".nbi", ".nbc")]) == 2, folder
    assert [p.name for p in used.iterdir() if p.name != ABOUT] == ["thesis.txt"]
    holder._lock.close()
    folders._tidy(tmp_path, present.name, ours, fresh=False)
    assert not running.exists()


def test_what_is_kept_survives_damage(tmp_path):
    """A file cut short or scrambled costs a compilation."""
    (tmp_path / "caller.py").write_text(CALLER)
    cache = tmp_path / "cache"
    environment = {"PYTHONPATH": f"{PACKAGE.parent}{os.pathsep}{tmp_path}", "STRIDOR_CACHE_DIR": str(cache)}

    def result():
        printed, noted = python(tmp_path / "caller.py", environment=environment)
        assert noted == ""
        return printed.split()

    first = result()
    for path in cache.rglob("*.nbc"):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 255
        path.write_bytes(bytes(content))
    for path in cache.rglob("*.nbi"):
        if "caller" not in path.name:
            path.write_bytes(path.read_bytes()[:20])
    assert result() == first
    assert result() == [*first[:-1], "1"]


# -- where nothing can be written
# ----------------------------------------------------------------------------------------------------------

SLIDE = "import caller; print(caller.slide(-1.0, 5.0, caller.LAW)[2], sum(caller.slide.stats.cache_hits.values()))"


def test_without_a_home_temporary_files_serve_and_a_note_says_so_once(tmp_path):
    nowhere = "/dev/null/home"
    (tmp_path / "caller.py").write_text(CALLER)
    environment = {
        "PYTHONPATH": f"{PACKAGE.parent}{os.pathsep}{tmp_path}", "HOME": nowhere,
        "XDG_CACHE_HOME": f"{nowhere}/cache", "TMPDIR": str(tmp_path),
    }  # fmt: skip
    for loaded in ("0", "1"):
        printed, noted = python("-c", SLIDE, environment=environment)
        assert printed.split() == ["2", loaded]
        assert len(noted.splitlines()) == 1
        assert re.match(
            rf"note: compiled functions cannot be kept in {nowhere}/cache/stridor/kernels \(.*\); they go to "
            rf"{tmp_path}/stridor-.*/kernels. STRIDOR_CACHE_DIR names another folder",
            noted,
        )


def test_where_nothing_at_all_can_be_written_everything_is_compiled(monkeypatch, caplog):
    caplog.set_level("WARNING", "stridor")
    monkeypatch.setattr(folders, "_candidates", lambda: iter([("/dev/null/a", False), ("/dev/null/b/c", True)]))
    assert folders.kernel_folder.__wrapped__() is None
    assert [r.message.split(",")[0] for r in caplog.records] == [
        "note: compiled functions cannot be kept in /dev/null/a (Not a directory)"
    ]


def test_a_folder_among_temporary_files_that_others_could_write_is_not_taken(tmp_path):
    """Machine code is loaded from it."""
    open_to_all = tmp_path / "stridor-0"
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    with pytest.raises(PermissionError):
        folders._claim(str(open_to_all / "kernels"))
    open_to_all.chmod(0o700)
    folders._claim(str(open_to_all / "kernels"))
    link = tmp_path / "stridor-1"
    link.symlink_to(open_to_all)
    with pytest.raises(PermissionError):
        folders._claim(str(link / "kernels"))


def test_the_note_stays_out_of_documents_and_of_quiet_runs(tmp_path):
    environment = {
        "PYTHONPATH": str(PACKAGE.parent), "HOME": "/dev/null/x", "XDG_CACHE_HOME": "/dev/null/x",
        "TMPDIR": str(tmp_path),
    }  # fmt: skip
    case = PACKAGE / "case" / "templates" / "two-beams.toml"
    words = ("-m", "stridor", "check", case, "--out", tmp_path)
    printed, noted = python(*words, "--json", environment=environment)
    assert json.loads(printed)
    assert [line.startswith("note: ") for line in noted.splitlines()].count(True) == 1
    assert python(*words, "--quiet", environment=environment)[1] == ""


def test_folders_named_by_the_user(tmp_path, monkeypatch):
    monkeypatch.setenv("STRIDOR_CACHE_DIR", str(tmp_path / "a"))
    assert next(folders._candidates()) == (str(tmp_path / "a" / "kernels"), False)
    monkeypatch.delenv("STRIDOR_CACHE_DIR")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "b"))
    assert next(folders._candidates()) == (str(tmp_path / "b" / "stridor" / "kernels"), False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # not to be followed
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(sys, "platform", "linux")
    assert next(folders._candidates()) == (str(tmp_path / "home" / ".cache" / "stridor" / "kernels"), False)


# -- the same bits in the process that compiles and in those that load
# ----------------------------------------------------------------------------------------------------------

# The pass of the time loop over all modes, too large to be inlined where it is called.
CLOSED = """
import numpy as np

from stridor.kernels import njit
from stridor.temporal.beta2 import scheme
from stridor.temporal.steppers.modal.layout import Fields, ModalRows
from stridor.temporal.steppers.modal.modal_path import modal_pass
from stridor.temporal.steppers.modal.operators import ModalArrays


@njit(cache=True)
def march(steps, modal, scheme, rows, force, fields, predicted):
    lost = 0.0
    for k in range(steps):
        force[0] = 1.0 + 0.1 * predicted[1]
        lost += modal_pass(modal, scheme, rows, force, fields, predicted)
    return lost


if __name__ == "__main__":
    import sys

    import closed

    n = 48
    k = np.arange(1.0, n + 1.0)
    modal = ModalArrays(1e-6 / (1 + k), 0.01 * k / n, 1e-6 * np.sin(k), 0.1 * k, k * k, np.array([0, 16, 48]))
    met = np.tile(np.arange(3), 2)
    rows = ModalRows(np.cos(np.outer(np.arange(4.0) + 1.0, k)), met, np.array([0, 3, 6]))
    fields = Fields(*(np.sin(k + j) for j in range(4)), np.zeros(0), np.zeros(n))
    arguments = (modal, scheme(1e-6, 0.5), rows, np.full(4, 0.3), fields, np.zeros(4))
    if sys.argv[1:] == ["callee"]:
        modal_pass(*arguments[:4], Fields(*(f.copy() for f in fields)), np.zeros(4))
    print(closed.march(500, *arguments).hex(), *(f.sum().hex() for f in fields))
"""


def test_the_process_that_compiles_and_those_that_load_compute_the_same_bits(tmp_path):
    """Whatever was called, compiled or loaded before."""
    (tmp_path / "closed.py").write_text(CLOSED)
    where = f"{PACKAGE.parent}{os.pathsep}{tmp_path}"

    def result(cache, *before):
        environment = {"PYTHONPATH": where, "STRIDOR_CACHE_DIR": str(tmp_path / cache)}
        return python(tmp_path / "closed.py", *before, environment=environment)[0]

    compiled = result("a")
    assert result("a") == compiled
    assert result("a", "callee") == compiled


def defined_functions(content: bytes) -> dict[str, bool]:
    """Functions that an ELF object (64 bits) defines for others, and whether another definition may replace each."""
    assert content[:5] == b"\x7fELF\x02"
    sections_at = struct.unpack_from("<Q", content, 40)[0]
    size, count = struct.unpack_from("<HH", content, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", content, sections_at + k * size) for k in range(count)]
    found = {}
    for section in sections:
        if section[1] != 2:  # the table of symbols
            continue
        names = sections[section[6]][4]
        for at in range(section[4], section[4] + section[5], 24):
            name, info, _, where = struct.unpack_from("<IBBH", content, at)
            if info & 15 == 2 and where != 0 and info >> 4 in (1, 2):
                start = names + name
                found[content[start : content.index(b"\0", start)].decode()] = info >> 4 == 2
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="reads ELF objects")
def test_no_code_that_is_kept_can_be_replaced_by_that_of_another_function():
    """What two objects define under one name, the process takes from the one that came first."""
    curve.weights_at(np.zeros(1, dtype=np.int64), np.full(1, 0.5), np.array([[-1, 0, 1, -1]]), np.ones((1, 3)))
    folder = kernel_folder()
    if folder is None:
        pytest.skip("nothing is kept here")
    objects = list(Path(folder.path).glob("*.nbc"))
    assert objects
    for path in objects:
        _, kind, (code, _) = pickle.loads(path.read_bytes()[32:])[0]
        assert kind == "object"
        weak = [name for name, replaceable in defined_functions(code).items() if replaceable]
        # Wrappers of parallel loops are called after an address in the process that compiled them: no name for two.
        weak = [name for name in weak if "__numba_parfor_gufunc_0x" not in name]
        assert not weak, f"{path.name}: {weak}"


def test_a_file_that_is_dated_ahead_has_not_changed_for_ever(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text("x = 1\n")
    ahead = time.time() + 3e7
    os.utime(file, (ahead, ahead))
    found = Sources(str(tmp_path), (str(file),), "")
    time.sleep(0.05)  # the system's clock of change times is coarse
    moment = time.time_ns()
    assert not found.changed_since(moment)
    time.sleep(0.05)
    file.write_text("x = 2\n")
    os.utime(file, (ahead, ahead))
    assert found.changed_since(moment)
    assert Sources("", (str(tmp_path / "gone.py"),), "").changed_since(moment)


# -- Ctrl-C
# ----------------------------------------------------------------------------------------------------------

# Code is handed over in callbacks of its generator, which drop what a handler raises in them.
TWICE = """
from stridor.kernels import njit


@njit(cache=True)
def twice(x):
    return 2.0 * x
"""
STOPPED = """
import os
import signal
import sys

from numba.core.registry import cpu_target

from stridor import interrupts


def hooked(hook, stops, seen):
    def call(*given):
        if stops and not seen:
            seen.append(True)
            signal.raise_signal(signal.SIGINT)
        return hook(*given)

    return call


def stopped(who, where):
    from doubled import twice

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell in the background may have switched it off
    if who == "program":
        interrupts.install()
    elif who == "page":  # has a handler of its own
        signal.signal(signal.SIGINT, lambda *_: interrupts.interrupt())
        interrupts.insist()
    seen = []
    codegen = cpu_target.target_context.codegen()
    library = codegen._library_class
    codegen._engine.set_object_cache(
        hooked(library._object_compiled_hook, where == "made", seen),
        hooked(library._object_getbuffer_hook, where == "fetched", seen),
    )
    try:
        twice(1.0)
        print(who, where, "went on")
    except KeyboardInterrupt:
        interrupts.heard()
        print(who, where, "interrupted")
    print(twice(2.0), bool(seen), flush=True)


if __name__ == "__main__":
    for who in ("library", "program", "page"):
        for where in ("made", "fetched"):  # the second finds what the first has kept
            child = os.fork()  # a process of its own, in which only numba is loaded: that takes most of the time
            if child == 0:
                os.environ["STRIDOR_CACHE_DIR"] = os.path.join(sys.argv[1], who)
                stopped(who, where)
                os._exit(0)
            assert os.waitpid(child, 0)[1] == 0
"""


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """What processes print that are interrupted while they compile a function, or fetch it; and their stderr."""
    folder = tmp_path_factory.mktemp("stopped")
    (folder / "doubled.py").write_text(TWICE)
    (folder / "stopped.py").write_text(STOPPED)
    environment = {"PYTHONPATH": os.pathsep.join([str(PACKAGE.parent), str(folder)])}
    return python(folder / "stopped.py", folder / "kept", environment=environment)


@pytest.mark.parametrize("who", ["library", "program", "page"])
def test_ctrl_c_while_code_is_made_or_fetched_is_an_interrupt_and_nothing_else(who, stopped):
    said, noted = stopped
    assert noted == ""
    for where in ("made", "fetched"):
        assert said.count(f"{who} {where} interrupted\n4.0 True\n") == 1, where
    assert said.count("True\n") == 6


def test_what_compiled_code_calls_has_no_entry_for_python_and_python_still_calls_it():
    @njit
    def twice(value):
        return 2.0 * value

    @njit
    def four_times(value):
        return twice(twice(value))

    assert four_times(1.5) == 6.0
    assert not twice.overloads
    (form,) = twice.get_overload.__self__.overloads.values()
    names = [function.name for function in form.library.get_defined_functions()]
    assert names
    assert not [name for name in names if name.startswith(form.fndesc.llvm_cpython_wrapper_name)]
    assert twice(1.5) == 3.0
    assert len(twice.overloads) == 1


def test_what_runs_on_other_threads_is_private_too():
    """Its code is met again by name otherwise: where it is compiled, that is another form than where it is loaded."""

    @njit(parallel=True)
    def squares(values):
        for i in numba.prange(len(values)):
            values[i] *= values[i]

    values = np.arange(4.0)
    squares(values)
    assert values.tolist() == [0.0, 1.0, 4.0, 9.0]
    (form,) = squares.overloads.values()
    defined = [f for f in form.library._final_module.functions if not f.is_declaration]
    assert [f.name for f in defined if "gufunc" in f.name]
    assert {f.linkage.name for f in defined} == {"external", "internal"}


def test_options_of_the_compiler_are_compared_as_numba_compares_them():
    def tables(options):
        return {name: getattr(options, name) for name in options.options}

    plain, same, said, other = (Flags() for _ in range(4))
    said.boundscheck = said.boundscheck  # its default, which it does not say else
    other.nrt = not other.nrt
    every = (plain, same, said, other, plain.copy(), other.copy())
    for one, two in itertools.product(every, every):
        assert (one == two) is (tables(one) == tables(two))
        if one == two:
            assert hash(one) == hash(two)
    assert plain != "plain"
    assert hash(plain) == hash(tuple(sorted(tables(plain))))  # as numba has it


def test_what_makes_arrays_cannot_say_that_it_makes_none():
    @njit(allocates=False)
    def mirrored(values):
        return np.zeros(3)

    with pytest.raises(numba.core.errors.NumbaError, match="Only accept returning of array passed into the function"):
        mirrored(np.ones(3))


# -- one process compiles
# ----------------------------------------------------------------------------------------------------------

TURNS = """
import sys
import numpy as np
from stridor.kernels import njit


@njit(cache=True)
def doubled(x):
    return 2.0 * x


if __name__ == "__main__":
    import turns

    print("begun", flush=True)
    print(turns.doubled(3.0), sum(turns.doubled.stats.cache_hits.values()), flush=True)
"""


@pytest.mark.skipif(turns_module.fcntl is None, reason="no locks on Windows: every process compiles for itself")
def test_of_two_processes_one_compiles_and_the_other_takes_what_it_has_kept(tmp_path, monkeypatch):
    (tmp_path / "turns.py").write_text(TURNS)
    cache = tmp_path / "cache"
    environment = {"PYTHONPATH": f"{PACKAGE.parent}{os.pathsep}{tmp_path}", "STRIDOR_CACHE_DIR": str(cache)}
    words = [sys.executable, str(tmp_path / "turns.py")]

    def run() -> subprocess.Popen[str]:
        own = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "PYTHONPATH")}
        return subprocess.Popen(words, env=own | environment, stdout=subprocess.PIPE, text=True)

    assert python(words[1], environment=environment)[0].split()[-1] == "0"
    (turn,) = (path for path in cache.rglob("turns.doubled*.turn") if "py" in path.name)
    kept = {path: path.read_bytes() for path in cache.rglob("turns.doubled*.nb[ic]")}
    for path in kept:
        path.unlink()
    mine = Turn(str(turn))
    mine.take()
    other = run()
    assert other.stdout is not None
    assert other.stdout.readline() == "begun\n"
    with pytest.raises(subprocess.TimeoutExpired):
        other.wait(1.0)  # it waits for what this process keeps
    for path, content in kept.items():
        path.write_bytes(content)
    mine.give()
    assert other.stdout.read().split() == ["6.0", "1"]
    assert other.wait(60) == 0
    # Nobody is waited for for ever, nor is one that has ended in the middle.
    monkeypatch.setattr(turns_module, "LONGEST", 0.1)
    mine.take()
    late = Turn(str(turn))
    late.take()
    assert late._file is None
    mine.give()
    late.take()
    assert late._file is not None
    late.give()
