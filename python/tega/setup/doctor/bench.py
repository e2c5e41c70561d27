"""Look on this machine for the four devices of the paper, without settings."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple, TypeVar

import msgspec

from tega.devices import DiscoveringDevice, Found, driver_class, list_drivers
from tega.devices.at_exit import closes_on_exit, release
from tega.devices.base import Kind, optional
from tega.devices.fingertip.video_nodes import video_nodes
from tega.errors import DeviceUnavailableError, MissingExtraError
from tega.setup.doctor.arm import try_arm, try_input, try_tracker
from tega.setup.doctor.findings import DriverCase, Examination, Finding, Status
from tega.setup.doctor.outputs import try_hand, try_vest
from tega.setup.doctor.sensors import FoundCamera, crowded, try_amplifier, try_camera

_Key = TypeVar("_Key")
_Answer = TypeVar("_Answer")


def in_time(
    jobs: Mapping[_Key, Callable[[], _Answer]], deadline_s: float, late: Callable[[_Key, float], _Answer]
) -> dict[_Key, _Answer]:
    """Run all jobs, which must not raise, at once for ``deadline_s`` at most; return their results, in their order.

    A job that is not done in time is left to itself: its thread does not keep the program from ending. ``late``,
    called with its key and the deadline, makes its answer.
    """
    answers: dict[_Key, _Answer] = {}

    def do(key: _Key, job: Callable[[], _Answer]) -> None:
        answers[key] = job()

    threads = [
        threading.Thread(target=do, args=item, name=f"tega-look-{item[0]}", daemon=True)
        for item in jobs.items()
    ]
    until_s = time.monotonic() + deadline_s
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(0.0, until_s - time.monotonic()))
    done = dict(answers)
    return {key: done[key] if key in done else late(key, deadline_s) for key in jobs}


POLL_S: Final = 3.5
"""Deadline of looking for devices, all drivers side by side."""
TRY_S: Final = 5.5
"""Deadline of trying those that were found, all side by side."""

ROLES: Final[Mapping[str, Kind]] = {"digit": "tactile", "emg": "emg", "vest": "vest", "allegro": "hand"}
"""Checks made without settings, and the kind of their drivers."""


# What is said of a kind of device that is missing, and the steps to take.
_ABSENT: Final[Mapping[str, tuple[str, tuple[str, ...]]]] = {
    "digit": (
        "No DIGIT is plugged in",
        (
            "plug one in with a cable that carries data (some only charge: lights on, nothing in lsusb), wait 3 s, "
            "look again",
            'any other camera will do for a first try: driver digit with source = "/dev/video0"',
        ),
    ),
    "emg": (
        "No EMG amplifier was found",
        (
            "plug the board or dongle in and switch it on (a Cyton's dongle: switch at GPIO 6)",
            "an amplifier with a program of its own: start its stream in that program",
        ),
    ),
    "vest": (
        "No vest answers",
        (
            "through the vendor's software: start the bHaptics Player and pair the vest in it",
            "by Bluetooth: switch the vest on, and close the Player and the phone's app, which would hold it",
        ),
    ),
    "allegro": (
        "There is no CAN bus, so no Allegro Hand",
        (
            "plug the CAN adapter in, then:\n"
            "sudo ip link set can0 up type can bitrate 1000000 restart-ms 100\n"
            "sudo ip link set can0 txqueuelen 100",
            "an adapter that is no network interface (PCAN-Basic, Kvaser) can be tried with settings only",
        ),
    ),
}


class DriverProbe(NamedTuple):
    """Result of looking for one driver's devices.

    ``could_not`` is why looking was not possible, ``""`` if it was, and ``hint`` the step that makes it so.
    ``lacks_package`` is whether the reason is a package that is not installed; ``likelihood`` is the driver's own.
    """

    kind: str
    found: Sequence[Found] = ()
    could_not: str = ""
    hint: str = ""
    lacks_package: bool = False
    likelihood: int = 0


def probe_drivers(deadline_s: float = POLL_S) -> dict[str, DriverProbe]:
    """Search for devices with every driver that can; opens nothing.

    The results are by the driver's name, in the order of ``tega-teleop devices``.
    """
    kinds = {
        record.name: record.kind
        for record in list_drivers()
        if record.kind and isinstance(driver_class(record.name), DiscoveringDevice)
    }
    return in_time(
        {name: partial(_check, kind, driver_class(name), 0.8 * deadline_s) for name, kind in kinds.items()},
        deadline_s,
        lambda name, s: DriverProbe(kinds[name], could_not=f"{name} did not answer within {s:g} s"),
    )


def _check(kind: str, driver: Any, timeout_s: float) -> DriverProbe:
    try:
        return DriverProbe(kind, driver.discover(timeout_s), likelihood=optional(driver, "likelihood"))
    except DeviceUnavailableError as error:
        lacks = isinstance(error, MissingExtraError)
        return DriverProbe(kind, could_not=error.message, hint=error.hint, lacks_package=lacks)
    except Exception as error:  # somebody's driver: the others are still looked for
        return DriverProbe(kind, could_not=f"unexpected {type(error).__name__}: {error}")


def probe_all() -> Examination:
    """Look for a DIGIT, an EMG amplifier, a vest and an Allegro Hand, and try those that may be opened.

    Takes at most :data:`POLL_S` and :data:`TRY_S` seconds, whatever hangs.
    """
    looked = {name: there for name, there in probe_drivers().items() if there.kind in ROLES.values()}
    cases: list[DriverCase] = []
    findings: list[Finding] = []
    if lacking := {name: there for name, there in looked.items() if there.lacks_package}:
        findings.append(
            Finding(
                check="packages",
                status="missing",
                finding="packages that drivers need are not installed",
                why=f"these could not look for their devices: {', '.join(lacking)}",
                todo=tuple(dict.fromkeys(there.hint for there in lacking.values() if there.hint)),
            )
        )
    for check, kind in ROLES.items():
        for name, there in looked.items():
            for found in there.found if there.kind == kind else ():
                if found.problem or not found.may_open:
                    findings.append(_seen(check, found))
                    continue
                options_type = driver_class(name).options_type
                cases.append(DriverCase(check, kind, name, msgspec.convert(found.options, options_type)))
    findings += try_all(cases, TRY_S)
    for check, kind in ROLES.items():
        if not any(f.check == check for f in findings):
            of_kind = {name: there for name, there in looked.items() if there.kind == kind}
            findings.append(_absent(check, of_kind))
    order = ["packages", *ROLES]
    findings.sort(key=lambda f: order.index(f.check))
    return Examination(settings="", findings=tuple(findings))


def try_all(cases: Sequence[DriverCase], deadline_s: float) -> list[Finding]:
    """Try devices through their drivers, side by side.

    Return at least one finding for each, in their order, and then those about several together.
    """
    cameras: list[FoundCamera] = []
    tries: dict[str, Callable[[DriverCase], list[Finding]]] = {
        "tactile": partial(try_camera, cameras),
        "emg": try_amplifier,
        "vest": try_vest,
        "hand": try_hand,
        "input": try_input,
        "tracker": try_tracker,
        "arm": try_arm,
    }

    def attempt(case: DriverCase) -> list[Finding]:
        try:
            return tries[case.kind](case)
        except Exception as error:  # a driver's mistake is one finding, not the end of the examination
            text = f"{case.driver} failed with an unexpected {type(error).__name__}: {error}"
            return [case.reported("", "error", text, todo=("report it to the author of the driver",))]

    def late(n: int, deadline_s: float) -> list[Finding]:
        text = f"{cases[n].driver} was not done within {deadline_s:g} s"
        why = "the device, its driver or the machine is held up"
        todo = ("unplug it, plug it in again and look once more",)
        return [cases[n].reported("", "error", text, why=why, todo=todo)]

    jobs = {n: partial(attempt, case) for n, case in enumerate(cases)}
    # Devices are opened in threads, and only the main one can see to it that SIGTERM closes them.
    closes_on_exit(_nothing)
    try:
        answers = in_time(jobs, deadline_s, late)
    finally:
        release(_nothing)
    return [finding for findings in answers.values() for finding in findings] + crowded(cameras)


def _nothing() -> None:
    """Stand for the devices that the threads hold."""


def _seen(check: str, found: Found) -> Finding:
    text = f"seen and not opened: {found.label} ({found.driver})"
    step = "tega-teleop init writes settings with it; then tega-teleop doctor lab.toml tries it"
    status: Status = "warning"
    if found.problem:
        status, text, step = "error", found.problem, found.hint
    case = DriverCase(check, ROLES[check], found.driver, None)
    return case.reported(found.label, status, text, why=found.note, todo=(step,) if step else ())


def _absent(check: str, looked: Mapping[str, DriverProbe]) -> Finding:
    text, todo = _ABSENT[check]
    searched = [name for name, there in looked.items() if not there.could_not]
    reasons = [unseen for name in searched if (unseen := optional(driver_class(name), "unseen"))]
    if check == "digit" and (others := ", ".join(f"{c.device} ({c.name})" for c in video_nodes())):
        reasons.append(f"other cameras there are: {others}")
    could_not = [there for there in looked.values() if there.could_not and not there.lacks_package]
    reasons += dict.fromkeys(there.could_not for there in could_not)
    if blind := ", ".join(name for name, there in looked.items() if there.lacks_package):
        reasons.append(f"{blind} could not look")
    hints = dict.fromkeys(there.hint for there in could_not if there.hint)
    return Finding(check=check, status="missing", finding=text, why="; ".join(reasons), todo=(*todo, *hints))
