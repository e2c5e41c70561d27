"""Keep a rater's file over recorded trials: events, trials that are over, and whether each was played whole."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from tega.errors import DeviceUnavailableError, InvalidValueError, RecordingError
from tega.study.journal import Journal, JournalEvent, Kind, counting
from tega.study.observe.observing import OBSERVED, checked_rater
from tega.study.observe.play_head import PlayHead
from tega.study.observe.recorded import RecordedTrial, Unseen, recorded_trials
from tega.study.observe.trial_pictures import Reel, read_reel
from tega.study.observers import PART, RECORDED, WHOLE, observer_path, saw_whole
from tega.study.plan import read_plan

_OVER = "all recordings are scored"


class Showing(NamedTuple):
    """The trial that is being scored.

    Attributes:
        trial: Which.
        reel: Its recording.
        head: Where in it the rater is.
        n_taken_back: Events that an earlier start had left in it unfinished; they count no more.
    """

    trial: RecordedTrial
    reel: Reel
    head: PlayHead
    n_taken_back: int = 0


class Scoring:
    """A rater's file, open, and the trial that is being scored.

    A trial is begun anew where an earlier start has left it before its end: what was scored in it is taken back, since
    nobody knows any more what of it was seen.

    Args:
        folder: The study's folder.
        participant: Whose trials.
        rater: Who scores, a code such as ``r3``.

    Attributes:
        rater: Who scores.
        journal: The rater's file.
        trials: The trials, in this rater's order.
        unseen: Trials that cannot be shown, and why.
        now: The trial that is being scored; ``None`` when all are.

    Raises:
        InvalidValueError: Nobody has that id, ``rater`` cannot be a file's name, or has scored otherwise.
        RecordingError: A file is damaged, belongs to another plan, or the person has withdrawn.
        DeviceUnavailableError: No trial can be shown, or the rater's file is open in another console.
    """

    def __init__(self, folder: Path, participant: str, rater: str) -> None:
        self.rater = checked_rater(rater)
        self.trials, self.unseen = recorded_trials(folder, participant, rater)
        signed = read_plan(folder).settings.plan_sha256
        self._heads: dict[str, PlayHead] = {}
        self.now: Showing | None = None
        path = observer_path(folder, participant, rater)
        new = not path.exists()
        self.journal = Journal(path)
        try:
            self._check(signed)
            begin_ns = min(trial.start_ns for trial in self.trials)
            self.journal.add("session_start", t_ns=begin_ns, source=rater, text=signed, item=RECORDED)
            self.go_on()
            self._check_any(participant)
        except BaseException:
            self.close()
            if new:  # nothing was scored: the code is free for another use
                path.unlink()
            raise

    @property
    def n_scored(self) -> int:
        """How many of the trials are over."""
        ended = {(e.trial, e.attempt) for e in self.journal.events if e.kind == "trial_end"}
        return sum((trial.trial, trial.attempt) in ended for trial in self.trials)

    def ended(self, trial: RecordedTrial) -> bool:
        """Tell whether the rater is through with a trial."""
        return any(
            (e.kind, e.trial, e.attempt) == ("trial_end", trial.trial, trial.attempt)
            for e in self.journal.events
        )

    def whole(self, trial: RecordedTrial) -> bool:
        """Tell whether the rater has seen all of a trial."""
        return saw_whole(self.journal.events, trial.trial, trial.attempt)

    def events(self) -> list[JournalEvent]:
        """Return the events that were added to the trial and not undone."""
        if self.now is None:
            return []
        mine = counting(self.journal.events, self.now.trial.trial, self.now.trial.attempt)
        return [event for event in mine if event.kind in {*OBSERVED, "note"}]

    def press(self, kind: Kind, at_ns: int) -> str:
        """Add an event.

        Args:
            kind: One of :data:`~tega.study.observe.observing.OBSERVED`.
            at_ns: Where in the trial.

        Returns:
            Why it was refused; ``""`` when it is on the disk.
        """
        return _OVER if self.now is None else self._add(self.now.trial, kind, at_ns)

    def undo(self, at_ns: int) -> str:
        """Take back what was added last to the trial; the reason where there is nothing."""
        events = self.events()
        if self.now is None or not events:
            return "there is nothing to undo"
        return self._add(self.now.trial, "undo", at_ns, undone=events[-1].n)

    def note(self, text: str, at_ns: int) -> None:
        """Add a note to the trial."""
        if self.now is not None:
            self._add(self.now.trial, "note", at_ns, text=text)

    def finish(self, *, sure: bool) -> str:
        """End the trial and go on to the next one that is not scored.

        Args:
            sure: End it although some of it was never played.

        Returns:
            Why it was refused; ``""`` when it is done.
        """
        if self.now is None:
            return _OVER
        trial, head = self.now.trial, self.now.head
        whole, ended = head.missed_ns == 0, self.ended(trial)
        if not ended and not head.seen_end:
            return "not seen to its end yet"
        if not ended and not whole and not sure:
            return f"{head.missed_ns / 1e9:.1f} s were passed over: go back to them, or Enter again to leave it so"
        if not ended or (whole and not self.whole(trial)):
            self._add(trial, "trial_end", trial.length_ns, text=WHOLE if whole else PART)
        self.go_on()
        return ""

    def go_on(self) -> None:
        """Open the first trial that is not scored; those that cannot be read are left out, with the reason."""
        while (trial := next((one for one in self.trials if not self.ended(one)), None)) is not None:
            if self._open(trial):
                return
        self.now = None

    def go_back(self) -> str:
        """Open the trial before this one in the rater's order; the reason where there is none."""
        place = len(self.trials) if self.now is None else self.trials.index(self.now.trial)
        for trial in reversed(self.trials[:place]):
            if self._open(trial):
                return ""
        return "this is the first recording"

    def close(self) -> None:
        """Close the file."""
        self.journal.close()

    def _check(self, signed: str) -> None:
        starts = [event for event in self.journal.events if event.kind == "session_start"]
        if any(event.text != signed for event in starts):
            raise RecordingError(f"{self.rater}'s file belongs to another plan", "open it in its own folder")
        if any(event.item != RECORDED for event in starts):
            raise InvalidValueError(
                f"{self.rater} has scored this session live or elsewhere",
                f"score its recordings under another code, such as --rater {self.rater}v",
            )

    def _check_any(self, participant: str) -> None:
        if not self.trials:
            why = "; ".join(f"{one.id}: {one.why}" for one in self.unseen)
            raise DeviceUnavailableError(f"{participant}: no recording to score: {why}")

    def _open(self, trial: RecordedTrial) -> bool:
        try:
            reel = read_reel(trial)
        except RecordingError as error:
            self.unseen.append(Unseen(trial.id, error.message))
            self.trials.remove(trial)
            return False
        n_back = 0
        if trial.id not in self._heads:
            self._heads[trial.id] = PlayHead(trial.length_ns)
            n_back = self._begin(trial)
        self.now = Showing(trial, reel, self._heads[trial.id], n_back)
        return True

    def _begin(self, trial: RecordedTrial) -> int:
        """Note that a trial has begun, once; take back what was scored in it where it was never ended."""
        mine = counting(self.journal.events, trial.trial, trial.attempt)
        if not any(event.kind == "trial_start" for event in mine):
            self._add(trial, "trial_start", 0)
        if self.ended(trial):
            return 0
        left = [event for event in mine if event.kind in OBSERVED]
        for event in left:
            self._add(trial, "undo", 0, undone=event.n)
        return len(left)

    def _add(
        self, trial: RecordedTrial, kind: Kind, at_ns: int, *, text: str = "", undone: int | None = None
    ) -> str:
        self.journal.add(
            kind,
            t_ns=trial.start_ns + at_ns,
            trial=trial.trial,
            attempt=trial.attempt,
            source=self.rater,
            text=text,
            undone=undone,
        )
        return ""
