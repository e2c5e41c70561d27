"""The soak itself: one fault after another, and what came of each."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from tega.errors import DeviceUnavailableError, TegaError
from tega.haptics import FINGERS
from tega.recording.mcap_folder import SessionFolder
from tega.runtime.files.toml_text import tree_text
from tega.runtime.threads import short_turns
from tega_campaigns.impaired import ImpairedLink
from tega_campaigns.runner import CampaignCase, run_cases, until
from tega_campaigns.soak.faults import Breaker, soak_settings
from tega_campaigns.soak.lost import KeptCounts, check
from tega_campaigns.soak.plan import KINDS, STATION_KINDS, Kind, Planned, plan
from tega_campaigns.soak.programs import Programs, SoakOperator
from tega_campaigns.soak.report import NOT_JUDGED, SoakFault, SoakReport
from tega_campaigns.standstill import Standstills, within_ns
from tega_campaigns.supervisor import SaidLine, Supervisor
from tega_emulators.lab import EmulatedLab, emulated_lab
from tega_emulators.stations import free_port, split, write_trees
from tega_emulators.vest_bench import felt_now, seen_by

__all__ = ["soak"]

_READY_S = 40.0
_REPORT_S = 8.0
_LIMP_S = 3.0
_STAYS_S = 1.0
# Of these a picture still comes often enough.
_FRESH = frozenset({"slow"})
_STARTS = 3
_STEP_S = 0.005
# A fault is only begun where there is time to see the end of it.
_ROOM_S = 6.0

# After these the run goes on by itself, though without what it lost, and is ended and started again.
_GOES_ON = frozenset({("computer", "disk"), ("arm", "kill"), ("recorder", "kill")})

Progress = Callable[[str, int, int], None]


def soak(
    folder: Path,
    *,
    seconds: float,
    seed: int,
    kinds: Sequence[Kind] | None = None,
    stations: bool = False,
    camera_hz: float = 60.0,
    keep: bool = False,
    patient: bool = False,
    progress: Progress = lambda _subject, _done, _total: None,
) -> SoakReport:
    """Run the whole system on emulated devices and make faults at random; Linux only.

    ``folder`` takes settings, recordings and the program's error output. ``seed`` is that of the faults,
    their order and times; ``kinds`` of ``None`` are all faults. ``stations`` runs two stations and a link
    between them instead of one program; ``camera_hz`` is that of each emulated DIGIT; ``keep`` keeps the
    recordings that have been looked through. ``patient`` is for a machine that does other work: the hand may
    be silent for a second and slow, which would end a run with the limits as they come. The report names it.
    """
    if sys.platform != "linux":
        raise DeviceUnavailableError(
            "soak: needs Linux: it fills the program's disk and stops its process by Linux's own means",
            "run it on Linux; replay, demo and the tests of drivers run here",
        )
    with ExitStack() as stack:
        lab = stack.enter_context(
            emulated_lab(
                folder,
                emg_hz=250.0,
                hand=True,
                vest="bhaptics-ble",
                fingers=FINGERS,
                arm=True,
                dead_man="pedal",
                camera_hz=camera_hz,
            )
        )
        tree = soak_settings(lab, folder, patient=patient)
        link, files = None, {"program": folder / "soak.toml"}
        if stations:
            port = free_port()
            link = stack.enter_context(ImpairedLink(port))
            listen, connect = (f"tcp/127.0.0.1:{at}" for at in (port, link.port))
            robot, operator = write_trees(folder, split(tree, listen=listen, connect=connect))
            files = {"robot": robot, "operator": operator}
        else:
            files["program"].write_text(tree_text(tree), encoding="utf-8")
        first = lab.go_ahead() and (link is None or link.go_ahead())
        programs = stack.enter_context(
            Programs(
                {
                    name: Supervisor(file, errors=folder / "errors.log", environment=lab.environment)
                    for name, file in files.items()
                }
            )
        )
        breaker = Breaker(lab, programs, link, folder)
        still = stack.enter_context(Standstills())
        stack.enter_context(
            short_turns()
        )  # what listens and what stands between stations waits for no thread
        soaked = _Soak(lab, folder, programs, breaker, still, keep=keep)
        report = soaked.report
        report.patient, report.emulators_first, report.stations = patient, first, stations
        stack.enter_context(soaked.operator.at_work())
        chosen = kinds if kinds is not None else STATION_KINDS if stations else KINDS
        return soaked.run(seconds, plan(seed, kinds=chosen), seed, progress)


class _Soak:
    def __init__(
        self,
        lab: EmulatedLab,
        folder: Path,
        programs: Programs,
        breaker: Breaker,
        still: Standstills,
        *,
        keep: bool,
    ) -> None:
        self._still, self._breaker = still, breaker
        self._lab, self._programs, self._keep = lab, programs, keep
        self._session = folder / "session"
        self.operator = SoakOperator(lab, lambda: programs.reported)
        self.report = SoakReport()
        self._began_s = 0.0
        self._looked: set[str] = set()

    def run(self, seconds: float, planned: Sequence[Planned], seed: int, progress: Progress) -> SoakReport:
        report, program = self.report, self._programs
        report.seed = seed
        if not self._start():
            report.failures.append(f"the run did not begin: {program.last_words}; {program.now}")
            return report
        self._began_s = time.monotonic()
        end_s = self._began_s + seconds
        for fault, still_ns in run_cases(self._cases(planned, end_s, progress), self._still):
            # What a kill leaves behind is no matter of time.
            if still_ns and not fault.good and fault.how != "kill":
                fault.outcome = f"{NOT_JUDGED}: the machine stood still for {still_ns / 1e9:.1f} s"
            report.faults.append(fault)
        while (left_s := end_s - time.monotonic()) > 0:
            progress("the rest", self._elapsed(), round(seconds))
            time.sleep(min(0.5, left_s))
        report.stood_still_s = self._still.total_s
        report.seconds = time.monotonic() - self._began_s
        self._finish()
        report.judge()
        return report

    def _cases(
        self, planned: Sequence[Planned], end_s: float, progress: Progress
    ) -> Iterator[CampaignCase[SoakFault]]:
        """Give one fault after another, each once all is well, for as long as there is time for one."""
        program = self._programs
        for k, each in enumerate(planned):
            if time.monotonic() + _ROOM_S > end_s:
                return
            name = f"{k + 1}: {each.fault.kind} of {each.fault.device}"
            progress(name, self._elapsed(), round(end_s - self._began_s))
            time.sleep(each.wait_s)
            until(lambda: program.well() or not program.alive, _READY_S)
            if not program.alive:
                self.report.failures.append(f"the run ended by itself: {program.last_words}")
                self._restart()
            yield CampaignCase({"fault": name}, partial(self._one, each))

    def _one(self, each: Planned) -> SoakFault:
        """Make one fault, take it away, and wait until all is well again."""
        kind, program = each.fault, self._programs
        fault = SoakFault(kind=kind.kind, device=kind.device, how=kind.how, injected_s=self._now())
        seen_s = time.monotonic()
        if kind.how == "kill" and (kind.device, kind.how) not in _GOES_ON:
            return self._kill(fault)
        at_ns = time.time_ns()
        self.operator.waits = True
        self._breaker.make(kind)
        over_s = time.monotonic() + each.lasts_s
        reported: SaidLine | None = None
        while reported is None and time.monotonic() < over_s + _REPORT_S:
            time.sleep(_STEP_S)
            reported = self._reported(kind, seen_s)
            if reported is None and kind.then == "recovers" and time.monotonic() > over_s:
                break
        # A fault that is over before it could be seen may be reported a moment later.
        time.sleep(max(0.0, over_s - time.monotonic()))
        still_felt = kind.device in FINGERS and kind.how not in _FRESH and self._felt(kind.device)
        vibrates = self._breaker.holds_up(kind) and until(self._lab.at_rest, _LIMP_S) is None
        self._breaker.mend(kind)
        self.operator.waits = False
        fault.ended_s = self._now()
        if reported is None:
            until(lambda: self._reported(kind, seen_s) is not None, 1.0)
            reported = self._reported(kind, seen_s)
        if reported is not None:
            fault.detected_s, fault.said = reported.at_s - self._began_s, kind.words(reported.said)
        if kind.then == "restarts" or not program.alive:
            self._look_after(fault, kind, at_ns)
        self._recover(fault, kind)
        if still_felt:
            fault.outcome = "its last picture was still felt"
        if vibrates:
            fault.outcome = "the vest still vibrated while the program was held up"
        return fault

    def _felt(self, finger: str) -> bool:
        """Return whether the emulated vest still shows a finger."""
        return bool(felt_now(self._lab.vest)[FINGERS.index(finger)])

    def _reported(self, kind: Kind, since_s: float) -> SaidLine | None:
        return next((line for line in self._programs.lines(since_s) if kind.words(line.said)), None)

    def _kill(self, fault: SoakFault) -> SoakFault:
        """Kill the program, see that the devices are safe without it, and start it again."""
        victim, since_s = self._programs[fault.device], time.monotonic()
        leads_devices = victim is self._programs.main
        arm = victim.arm_process()
        killed_ns = victim.kill()
        fault.ended_s = self._now()

        def safe() -> bool:
            if leads_devices:
                return self._lab.limp() and self._lab.at_rest() and not _runs(arm)
            return self._lab.at_rest() and any(
                line.said.get("state") not in {None, "active"} for line in self._programs.lines(since_s)
            )

        if until(safe, _LIMP_S) is not None:
            fault.detected_s = self._now()
            fault.said = "the vest is at rest, the robot no longer obeys"
            if leads_devices:
                fault.said = "the guard let go of the hand, the vest is at rest, the arm's process has ended"
        if leads_devices:
            for recovered in SessionFolder(self._session).recovered:
                self._lose(recovered.path, killed_ns)
        self.report.restarts += 1
        self._start(renewed=False)
        self._recover(fault, None)
        return fault

    def _look_after(self, fault: SoakFault, kind: Kind, at_ns: int) -> None:
        """After a fault that ends a run or its recording: see that all is safe, and start again."""
        program = self._programs
        if program.alive and (kind.device, kind.how) not in _GOES_ON:
            until(lambda: not program.alive, _REPORT_S)
        program.end()
        if until(lambda: self._lab.limp() and self._lab.at_rest(), _LIMP_S) is None:
            self.report.failures.append(f"after {fault.kind} of {fault.device} hand or vest were not at rest")
        if kind.how == "disk" or kind.device == "recorder":
            for recovered in SessionFolder(self._session).recovered:
                self._lose(recovered.path, at_ns)
        self._restart()

    def _recover(self, fault: SoakFault, kind: Kind | None) -> None:
        program = self._programs
        well_s = self._well_again()
        if well_s is not None:
            fault.recovered_s = well_s - self._began_s
        elif not program.alive:
            fault.outcome = f"the program ended: {program.last_words}"
            self._restart()
            return
        else:
            fault.outcome = f"not well again: {program.now}"
            return
        restarted = kind is None or kind.then == "restarts"
        fault.outcome = "restarted" if restarted else "recovered"
        if fault.detected_s is None:
            fault.outcome = "not reported"

    def _well_again(self) -> float | None:
        """Wait until all is well and stays so for a while; return since when."""
        program, began_s = self._programs, time.monotonic()
        since_s: float | None = None
        while time.monotonic() < began_s + _READY_S and program.alive:
            if not program.well(began_s):
                since_s = None
            elif since_s is None:
                since_s = time.monotonic()
            elif time.monotonic() > since_s + _STAYS_S:
                return since_s
            time.sleep(_STEP_S)
        return None

    def _restart(self) -> None:
        self._programs.end()
        self._look_through()
        self.report.restarts += 1
        self._start()

    def _start(self, *, renewed: bool = True) -> bool:
        """Start what does not run, again where a device did not answer in time; return whether all is well.

        With ``renewed`` all of it is ended first.
        """
        program = self._programs
        for k in range(_STARTS):
            if renewed or k:
                program.end()
            program.start()
            began = until(lambda: program.well() or not program.alive, _READY_S)
            if began is not None and program.alive:
                return True
        return False

    def _finish(self) -> None:
        report, program, lab = self.report, self._programs, self._lab
        code = program.end()
        if code != 0:
            report.failures.append(f"the run ended with {code}: {program.last_words}")
        if until(lambda: lab.limp() and lab.at_rest(), _LIMP_S) is None:
            report.failures.append("at the end hand or vest were not at rest")
        self._look_through()
        vest, hand = seen_by(lab.vest), lab.hand.say("look")
        report.over_limit |= {"vest": vest.over, "hand": hand["over"]}
        report.commands |= {"vest": vest.received, "hand": hand["torques"]}
        report.failures += [f"the vest was sent {error}" for error in dict.fromkeys(vest.errors)]
        report.memory = [
            [(at_s - self._began_s, mib) for at_s, mib in process] for process in program.memory if process
        ]
        longest = max(report.memory, key=lambda process: process[-1][0] - process[0][0])
        some = max(1, len(longest) // 10)
        # The first seconds fill queues and pools.
        settled = [mib for at_s, mib in longest if at_s > longest[0][0] + 5.0] or [mib for _, mib in longest]
        report.rss_mib_start = statistics.median(settled[:some])
        report.rss_mib_end = statistics.median(settled[-some:])

    def _look_through(self) -> None:
        """Look through every recording that is finished and was not looked at yet."""
        if not self._session.exists():
            return
        for path in sorted(self._session.glob("*.mcap")):
            if path.name not in self._looked:
                self._lose(path, None)

    def _lose(self, path: Path, end_ns: int | None) -> None:
        report = self.report
        self._looked.add(path.name)
        try:
            kept: KeptCounts = check(path)
        except TegaError as error:
            report.failures.append(f"{path.name} cannot be read: {error}")
            return
        report.recordings += 1
        report.commands["arm"] = report.commands.get("arm", 0) + kept.arm_targets
        report.over_limit["arm"] = report.over_limit.get("arm", 0) + kept.arm_over
        if kept.cut:
            report.failures.append(f"{path.name} is cut: {kept.cut}")
        at_end_s = 0.0 if end_ns is None else max(0.0, (end_ns - kept.newest_ns) / 1e9)
        # While the soak itself had stopped the program there was nothing to record; a slow machine is no excuse.
        gaps_s = [
            (till - since - within_ns(self._breaker.held, since, till)) / 1e9 for since, till in kept.gaps
        ]
        for where, lost_s in {
            "at its end": at_end_s,
            "in records that did not fit": kept.dropped_s,
            "in a gap": max(gaps_s, default=0.0),
        }.items():
            if lost_s > report.lost_s:
                report.lost_s, report.lost_where = lost_s, f"{path.name} {where}"
        if not self._keep:
            path.unlink()

    def _now(self) -> float:
        return time.monotonic() - self._began_s

    def _elapsed(self) -> int:
        return round(self._now())


def _runs(pid: int | None) -> bool:
    """Return whether a process is still there."""
    return pid is not None and Path(f"/proc/{pid}/stat").exists()
