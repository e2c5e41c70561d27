"""Print and draw what the page on the simulated person shows: parameters and a picture of EMG; score held levels.

``python -m tega_figures.simulated_person parameters`` or ``picture FILE``. :func:`hold_shares` says how well levels can
be held: by a person's muscles and the real chain, nothing else.
"""

from __future__ import annotations

from pathlib import Path

import click
import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.emg import GraspIntent, Preset
from tega.errors import MissingExtraError, TegaError
from tega_sim.operator import ForearmEmg, ScriptedOperator, calibrate, load_parameters, typical_person
from tega_sim.operator.motor import MuscleMotor
from tega_sim.operator.person import PersonNumbers, stream

__all__ = ["hold_shares", "unsteady"]


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command()
def parameters() -> None:
    """Print the parameters as Markdown."""
    click.echo(parameter_table())


@main.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
def picture(file: Path) -> None:
    """Draw EMG and the levels that the chain makes of it into FILE."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise click.ClickException(
            str(MissingExtraError("the picture needs matplotlib", "pip install 'tega[pictures]'"))
        ) from error

    person = typical_person()
    maxima, tau, full_effort = calibrate(person, seed=1)
    script = ScriptedOperator(full_effort=full_effort)
    forearm, intent = ForearmEmg(person, seed=1), GraspIntent(1000, maxima, tau=tau)
    acts = [script.at(tick / 100) for tick in range(1400)]
    samples = np.concatenate([forearm.samples(act) for act in acts])
    levels = intent.process(samples)
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    t_s = np.arange(len(samples)) / 1000
    for m, (ax, name) in enumerate(zip(axes[:3], ("ECR", "FCU", "FDS"), strict=True)):
        ax.plot(t_s, samples[:, m] / 1e3, lw=0.3, color="#1f5fbf")
        ax.set_ylabel(f"{name}, mV")
    axes[3].plot(
        np.arange(len(acts)) / 100,
        [4 * a.excitation / full_effort + 0.5 for a in acts],
        color="0.6",
        label="meant",
    )
    axes[3].step(
        (np.arange(len(levels)) + 1) * tau / 1000, levels, where="post", color="#c8202f", label="level"
    )
    axes[3].set(ylabel="level", xlabel="time, s", ylim=(0, 5.5))
    axes[3].legend(loc="upper right")
    axes[0].set_title("Simulated EMG of a scripted grasp, and the levels of the real chain (preset live)")
    figure.savefig(file, dpi=110)


def parameter_table() -> str:
    """Return every parameter as Markdown, a table a section."""
    loaded = load_parameters()
    lines = [f"SHA-256 of the file: `{loaded.digest}`."]
    last = ""
    for section, name, p in loaded:
        if section != last:
            lines += ["", f"**{section}**", "", "| parameter | value | sd | range | unit | mark | source |"]
            lines.append("|---|---|---|---|---|---|---|")
            last = section
        spread = "" if p.sd == 0 else f"{p.sd:g}{' (ln)' if p.law == 'lognormal' else ''}"
        lines.append(
            f"| `{name}` | {p.value:g} | {spread} | {p.low:g} to {p.high:g} | {p.unit} | {p.mark} | {p.source} |"
        )
    return "\n".join(lines)


_HOLD_S = 4.0
_RISE_BLOCKS = 10


def unsteady(person: PersonNumbers, *, aim_sd: float, gain_sd: float) -> PersonNumbers:
    """Return the person with other errors of aim and of the electrodes, and without slack and artefacts."""
    motor = msgspec.structs.replace(person.motor, aim_sd=aim_sd, aim_floor=0.2 * aim_sd, slack_per_s=0.0)
    emg = msgspec.structs.replace(person.emg, gain_sd=gain_sd, artefact_hz=0.0)
    return msgspec.structs.replace(person, motor=motor, emg=emg)


def hold_shares(person: PersonNumbers, *, preset: Preset, n_holds: int, seed: int = 0) -> NDArray[np.float64]:
    """Return the share of 100 ms blocks at the intended level, of holds of three seconds after the rise.

    float64 (5,), for the levels 1 to 5. ``preset`` is of the calibration and of the chain. Each of the
    ``n_holds`` of a level has a calibration of its own; ``seed`` is of the first, the others follow.
    """
    shares = np.zeros((n_holds, 5))
    for hold in range(n_holds):
        maxima, tau, full_effort = calibrate(person, seed=seed + hold, preset=preset)
        for level in range(1, 6):
            aim, sense = (
                stream(seed + hold, "hold", level, "aim"),
                stream(seed + hold, "hold", level, "sense"),
            )
            muscles = MuscleMotor(person.motor, full_effort=full_effort, aim=aim, sense=sense)
            muscles.command(level)
            course = [muscles.step(tick / 100, 0.01) for tick in range(round(100 * _HOLD_S))]
            intent = GraspIntent(1000, maxima, tau=tau, preset=preset)
            levels = intent.process(ForearmEmg(person, seed=seed + hold, label=level).course(course))
            shares[hold, level - 1] = np.mean(levels[_RISE_BLOCKS:] == level)
    mean: NDArray[np.float64] = shares.mean(axis=0)
    return mean


if __name__ == "__main__":
    try:
        main()
    except TegaError as error:
        raise SystemExit(f"error: {error}") from None
