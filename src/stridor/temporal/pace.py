"""How many steps to run at once, and on how many threads: what turns out to be fast, never what changes a result.

On a machine of one's own two threads nearly halve the time of a large model's step. Where other work takes a core away,
each step waits for the thread that was put aside, and may take ten times as long as on one thread. The two parts of the
structure give the same numbers one after the other, so the choice may follow the clock.
"""

from __future__ import annotations

from dataclasses import dataclass, field

CHUNK_SECONDS = 1.0
LONGEST_CHUNK = 20_000
TRIAL_STEPS = 20
RETRY_CHUNKS = 20


@dataclass
class Pace:
    """threaded: whether two threads can be used at all. seconds: measured per step, on one and on two threads."""

    threaded: bool
    seconds: list[float | None] = field(default_factory=lambda: [None, None])
    chunks: int = 0
    two: bool = False
    trial: bool = True

    def begin(self) -> int:
        """Choose threads (``two``) for the next chunk; the most steps it should have."""
        one, both = self.seconds
        self.trial = True
        if self.chunks == 0:
            self.two = self.threaded  # compiles, or loads what was compiled: not measured
        elif not self.threaded:
            self.two, self.trial = False, one is None
        elif both is None or one is None:
            self.two = both is None
        else:
            self.two = both < one
            self.trial = self.chunks % RETRY_CHUNKS == 0
            if self.trial:
                self.two = not self.two
        expected = self.seconds[self.two]
        if self.trial or expected is None:
            return TRIAL_STEPS
        return max(1, min(LONGEST_CHUNK, int(CHUNK_SECONDS / max(expected, 1e-9))))

    def end(self, steps: int, seconds: float) -> None:
        """Take note of how long the chunk took."""
        if self.chunks > 0:
            self.seconds[self.two] = seconds / steps
        self.chunks += 1
