"""How many steps at once and on how many threads: trials first, then the faster, tried again now and then."""

import pytest

from stridor.temporal.pace import CHUNK_SECONDS, LONGEST_CHUNK, RETRY_CHUNKS, TRIAL_STEPS, Pace


def after(pace: Pace, steps: int, *, one: float, both: float) -> tuple[int, bool]:
    """Steps and threads of the next chunk where a step takes these times [s] on one and on two threads."""
    size = pace.begin()
    two = pace.two
    pace.end(size if steps == 0 else steps, (both if two else one) * (size if steps == 0 else steps))
    return size, two


def test_the_first_chunk_compiles_and_is_not_measured() -> None:
    pace = Pace(threaded=True)
    assert after(pace, 0, one=1e-3, both=50.0) == (TRIAL_STEPS, True)
    assert pace.seconds == [None, None]
    assert after(pace, 0, one=1e-3, both=5e-4) == (TRIAL_STEPS, True)
    assert pace.seconds == pytest.approx([None, 5e-4])
    assert after(pace, 0, one=1e-3, both=5e-4) == (TRIAL_STEPS, False)
    assert pace.seconds == pytest.approx([1e-3, 5e-4])


@pytest.mark.parametrize(("one", "both"), [(1e-3, 5e-4), (5e-4, 1e-3)])
def test_the_faster_goes_on_and_the_other_is_tried_again(one: float, both: float) -> None:
    pace = Pace(threaded=True)
    for _ in range(3):
        after(pace, 0, one=one, both=both)
    for chunk in range(3, 2 * RETRY_CHUNKS + 2):
        size, two = after(pace, 0, one=one, both=both)
        if chunk % RETRY_CHUNKS == 0:
            assert (size, two) == (TRIAL_STEPS, not both < one)
        else:
            assert two == (both < one)
            assert size == pytest.approx(CHUNK_SECONDS / min(one, both), abs=1)


def test_one_thread_where_two_cannot_be_used() -> None:
    pace = Pace(threaded=False)
    assert after(pace, 0, one=1e-3, both=1e-9) == (TRIAL_STEPS, False)
    assert after(pace, 0, one=1e-3, both=1e-9) == (TRIAL_STEPS, False)
    assert after(pace, 0, one=1e-3, both=1e-9) == (pytest.approx(1000, abs=1), False)


def test_chunks_are_bounded_for_tiny_and_for_endless_steps() -> None:
    quick, slow = Pace(threaded=False), Pace(threaded=False)
    for _ in range(2):
        after(quick, 0, one=1e-7, both=1.0)
        after(slow, 0, one=30.0, both=1.0)
    assert quick.begin() == LONGEST_CHUNK
    assert slow.begin() == 1
