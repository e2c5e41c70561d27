"""Print and draw what the page on the simulated person shows: parameters and a picture of EMG.

``python -m tega_figures.simulated_person parameters`` or ``picture FILE``.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from tega.emg import GraspIntent
from tega.errors import TegaError
from tega.runtime.lifecycle import require
from tega_sim.operator import ForearmEmg, ScriptedOperator, calibrate, load_parameters, typical_person


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
    figures = require("matplotlib.figure", driver="the picture", extra="pictures")
    person = typical_person()
    maxima, tau, full_effort = calibrate(person, seed=1)
    script = ScriptedOperator(full_effort=full_effort)
    forearm, intent = ForearmEmg(person, seed=1), GraspIntent(1000, maxima, tau=tau)
    acts = [script.at(tick / 100) for tick in range(1400)]
    samples = np.concatenate([forearm.samples(act) for act in acts])
    levels = intent.process(samples)
    figure = figures.Figure(figsize=(9, 6), layout="constrained")
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


if __name__ == "__main__":
    try:
        main()
    except TegaError as error:
        raise SystemExit(f"error: {error}") from None
