"""Answer the questions of a vest's calibration from what the emulated motors really did."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tega.config.calibration.wearing import SITES, site_motors

__all__ = ["History", "Wearer"]

History = list[tuple[float, list[int]]]
"""Every change of the 40 motors: seconds, then percent."""


class Wearer:
    """A made-up wearer of the vest.

    ``history`` returns what the motors did so far. ``threshold`` is the lowest percent that is felt, by
    column, ``step`` the smallest increase in percent that is noticed, ``mirrored`` whether the back is felt
    mirrored. ``requested`` are the columns that vibrated before each question, ``loudest`` the highest
    percent so far.
    """

    def __init__(
        self,
        history: Callable[[], History],
        threshold: Mapping[str, int],
        *,
        step: int = 13,
        mirrored: bool = False,
    ) -> None:
        self._history = history
        self._threshold = threshold
        self._step = step
        self._mirrored = mirrored
        self._n_seen = len(history())
        self._n_again = 0
        self.requested: list[str] = []
        self.loudest = 0

    def __call__(self, prompt: str) -> str | None:
        """Answer one prompt, ``> …`` or ``? …``; ``q`` to a question that is not about the vest."""
        if prompt.startswith(">"):
            return ""
        bursts = self._bursts()
        self.requested += [site for site, _ in bursts[:1]]
        n_due, self._n_again = (2 if "stronger" in prompt else 1), self._n_again + 1
        # What a busy machine swallowed is asked for once more, as a person would; a silent trial stays silent.
        if len(bursts) != n_due and self._n_again < 3:
            return "r"
        self._n_again = 0
        if "Where" in prompt:
            site = bursts[0][0] if bursts else "n"
            return f"b{5 - int(site[1])}" if self._mirrored and site[0] == "b" else site
        if "Felt" in prompt:
            return "y" if bursts and bursts[0][1] >= self._threshold[bursts[0][0]] else "n"
        if "stronger" in prompt:
            (_, first), (_, second) = bursts if len(bursts) == 2 else [("", 0)] * 2
            return "s" if abs(first - second) < self._step else "12"[second > first]
        return "q"

    def _bursts(self) -> list[tuple[str, int]]:
        """What vibrated since the last question: column and percent, one each."""
        history = self._history()
        new, self._n_seen = history[self._n_seen :], len(history)
        bursts: list[tuple[str, int]] = []
        dark = True
        for _, motors in new:
            lit = {k for k, v in enumerate(motors) if v}
            self.loudest = max(self.loudest, *motors)
            if lit and dark:
                (site,) = [s for s in SITES if lit == set(site_motors(s))]
                bursts.append((site, max(motors)))
            dark = not lit
        return bursts
