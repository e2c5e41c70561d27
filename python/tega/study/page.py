"""The page of a report, from an analysis and its drawings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tega.study.analyse import Analysis
from tega.study.markup import anchor_of, esc, fold, number, p_value, picture, table, with_interval
from tega.study.page_scores import scores_html
from tega.study.page_silico import assumptions_html, directions_html, sensitivity_html
from tega.study.paper import PAPER_OBJECTS, PAPER_TABLE_1
from tega.study.report_text import ALONE, METHODS, STYLE
from tega.study.tables import PAPER_LABELS, table_1

__all__ = ["report_html"]


def report_html(analysis: Analysis, figures: Mapping[str, str]) -> str:
    """Return the page."""
    a, b = analysis.conditions[:2]
    kind = "Simulated study" if analysis.simulated else "Study"
    parts = [
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
        f"<title>{kind}: {esc(a)} against {esc(b)}</title>",
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body>',
        f"<h1>{kind}: {esc(a)} against {esc(b)}</h1>",
    ]
    if analysis.simulated:
        parts.append(
            '<p class="banner">Everything here is simulated: made-up people, hand, objects and touch. It says what '
            "follows from the model's assumptions, and nothing about people.</p>"
        )
    if analysis.rehearsed:
        parts.append(
            '<p class="banner">Not data of people: the sessions of '
            f"{esc(', '.join(analysis.rehearsed))} ran on simulated or emulated devices, wholly or in part.</p>"
        )
    if analysis.interim:
        shown = (
            "They are shown because somebody asked."
            if analysis.p_shown
            else "p-values are withheld until it is."
        )
        parts.append(
            '<p class="banner">Interim: the plan is not done yet. Looking at p-values before, and stopping where one '
            f"is small, makes them worthless. {shown}</p>"
        )
    parts += [_flow(analysis), _table_1(analysis), directions_html(analysis), _family(analysis, figures)]
    parts += [
        _touch(analysis, figures),
        sensitivity_html(analysis),
        scores_html(analysis),
        _planner(analysis),
    ]
    parts += [METHODS, assumptions_html(analysis), _details(analysis), "</body></html>\n"]
    return "\n".join(parts)


def _flow(analysis: Analysis) -> str:
    flow = analysis.flow
    planned = "" if flow.planned_people is None else f" of {flow.planned_people} planned"
    gone = f", {flow.withdrawn} withdrew" if flow.withdrawn else ""
    ended = ", ".join(f"{n} {esc(status.replace('_', ' '))}" for status, n in flow.status.items())
    redone = "; ".join(f"{esc(trial)}: {esc(why)}" for trial, why in flow.redone.items())
    again = f" Done again, so that the first attempt does not count: {redone}." if redone else ""
    signed = f" Plan <code>{analysis.plan_sha256[:16]}</code>." if analysis.plan_sha256 else ""
    return (
        f"<p>{flow.people} {_people(flow.people, analysis)}{planned}{gone}; {flow.complete} complete. "
        f"Trials: {ended}. "
        f"A trial that was failed is data; one that was broken off is not.{again}{signed}</p>"
    )


def _people(n: int, analysis: Analysis) -> str:
    return ("simulated " if analysis.simulated else "") + ("person" if n == 1 else "people")


def _table_1(analysis: Analysis) -> str:
    rows = table_1(analysis)
    of = {(cell.object, cell.condition): cell for cell in analysis.cells}
    in_paper = analysis.objects == PAPER_OBJECTS and not PAPER_TABLE_1.keys().isdisjoint(analysis.conditions)
    beside = analysis.simulated and in_paper
    head = [*rows[0], *([f"paper: {name}" for name in PAPER_OBJECTS] if beside else [])]
    body = []
    for row, (condition, metric) in zip(
        rows[1:], ((c, m) for c in analysis.conditions for m in PAPER_LABELS), strict=True
    ):
        cells = []
        for name, text in zip(analysis.objects, row[2:], strict=True):
            cell = of[name, condition]
            link = f'<a href="#{anchor_of(name, condition)}">{esc(text)}</a>'
            if metric == "success":
                extra = f"{100 * cell.success_low:.0f}–{100 * cell.success_high:.0f}&nbsp;%"
            else:
                sd = getattr(cell, {"duration_s": "duration_sd_s"}.get(metric, f"{metric}_sd"))
                extra = "" if sd is None else f"SD {sd:.2g}"
            if (
                metric == "duration_s"
                and cell.successes < len(cell.trials)
                and cell.duration_success_s is not None
            ):
                extra += f"<br>of successes {cell.duration_success_s:.1f}"
            cells.append(f'{link} <span class="small">{extra}</span>')
        printed = PAPER_TABLE_1.get(condition, {}).get(metric, ("–",) * len(PAPER_OBJECTS)) if beside else ()
        body.append([esc(row[0]), esc(row[1]) + (", s" if metric == "duration_s" else ""), *cells, *printed])
    note = (
        "Means over trials. Success: trials that were lifted to the height, held, and not dropped, of "
        "all, with the exact "
        "95 % interval. Slips after lift-off. Each number leads to its trials, and they to their events."
    )
    if beside:
        note += (
            " The paper's columns stand as printed; its times have no unit, and fit the 15 s window only as "
            "sums of ten trials."
        )
    return "<h2>Table I</h2>" + table(head, body, note)


def _family(analysis: Analysis, figures: Mapping[str, str]) -> str:
    body = []
    for test in analysis.family:
        metric, _, name = test.partition(":")
        mine = [t for t in analysis.tests if (t.metric, t.object) == (metric, name)]
        printed = next((t for t in mine if t.level == "as printed"), None)
        people = next((t for t in mine if t.level == "people"), None)
        row = [esc(PAPER_LABELS[metric]), esc(name)]
        if printed is None:
            row += ["–"] * 4
        else:
            how = "exact" if ", exact" in printed.test else "approx."
            row += [
                with_interval(printed.effect, printed.low, printed.high),
                f"{p_value(printed.p)} <span class='small'>{how}</span>",
                p_value(printed.p_exact),
                p_value(printed.p_holm),
            ]
        row += ["–"] * 3 if people is None else [
            with_interval(people.effect, people.low, people.high),
            p_value(people.p),
            p_value(people.p_holm),
        ]  # fmt: skip
        body.append(row)
    head = ["metric", "object", "rank-biserial", "Mann-Whitney p", "exact p with ties", "Holm"]
    head += ["ratio of means", "p over people", "Holm"]
    note = (
        "First three p: trials taken as independent, as the paper does; says nothing about other people. "
        "Last columns: "
        f"people as the unit; no p below six people. Holm over the {len(analysis.family)} tests of the "
        "plan, within each kind. "
        f"Rank-biserial above 0 and ratios above 1: more with {esc(analysis.conditions[0])}. Brackets: 95 % "
        "intervals; that of counts' ratio is by t and the p by sign-flips, which are coarser with few people."
    )
    caption = (
        f"Fig 7. {_cells_text(analysis)} Dots: trials; violins: their spread; diamonds: means; "
        "p: Mann-Whitney over trials, uncorrected, as in the paper."
    )
    return "<h2>Tests</h2>" + table(head, body, note) + picture(figures, "fig7", caption)


def _cells_text(analysis: Analysis) -> str:
    n = [len(cell.trials) for cell in analysis.cells]
    people = [cell.people for cell in analysis.cells]
    trials = f"{min(n)} to {max(n)}" if min(n) != max(n) else f"{n[0]}"
    return f"{trials} trials in each violin, of {max(people)} {_people(max(people), analysis)}."


def _touch(analysis: Analysis, figures: Mapping[str, str]) -> str:
    shown = "<h2>Touch and pose</h2>" + picture(figures, "fig3", _fig_3_caption(analysis))
    if not analysis.arms:
        return shown + "<p>No courses of touch and pose were kept with these trials.</p>"
    head = [
        "condition",
        "signal",
        "trials",
        "people",
        "r",
        "lowest",
        "r > 0",
        "r, all samples",
        "other trials' touch",
    ]
    head += ["peak lag, s", "answer, levels per unit"]
    body = [
        [
            esc(arm.condition),
            arm.signal.upper(),
            str(arm.trials),
            str(arm.people),
            number(arm.r),
            number(arm.lowest),
            f"{100 * arm.positive:.0f}&nbsp;%",
            number(arm.r_pooled),
            number(arm.r_others),
            number(arm.peak_lag_s, 1),
            number(arm.slope),
        ]
        for arm in analysis.arms
    ]
    text = shown + table(head, body, ALONE)
    if analysis.contrasts:
        rows = [
            [
                c.signal.upper(),
                {"r": "r (Fisher z)", "slope": "answer"}[c.what],
                str(c.people),
                number(c.difference),
                p_value(c.p),
            ]
            for c in analysis.contrasts
        ]
        a, b = analysis.conditions[:2]
        note = f"{esc(a)} less {esc(b)}, person by person; sign-flip p, exploratory, uncorrected."
        text += table(["signal", "what", "people", "difference", "p"], rows, note)
    text += picture(
        figures, "lags", "Correlation over the lag; the cross is what other trials' touch gives at lag 0."
    )
    who = analysis.conditions[0]
    fig8 = f"Fig 8. First person with courses, first three {who} trials of each object, in the plan's order."
    text += picture(figures, "fig8", fig8)
    head = [
        "object",
        "condition",
        "trials",
        *[f"pose {p}" for p in range(5)],
        "1 to 3",
        "changes",
        "of them 1 to 3",
        "no touch",
    ]
    uses = [
        [
            esc(u.object),
            esc(u.condition),
            str(u.trials),
            *(f"{100 * share:.0f}&nbsp;%" for share in (*u.dwell, u.intermediate)),
            f"{u.transitions:.1f}",
            f"{u.transitions_intermediate:.1f}",
            "–" if u.silent is None else f"{100 * u.silent:.0f}&nbsp;%",
        ]
        for u in analysis.pose_use
    ]
    note = (
        "Share of time at each pose and changes per trial, means over trials. The paper takes use of poses "
        "1 to 3 as graded control; a hand that closes step by step passes through them as well. No touch: share of "
        "the time with a closed hand after lift-off in which no finger is read as touching; the vest is still then."
    )
    return text + picture(figures, "poses", "Share of time at each pose.") + table(head, uses, note)


def _fig_3_caption(analysis: Analysis) -> str:
    kind = "simulated" if analysis.simulated else "recorded"
    trials = ", ".join(row.trial for row in analysis.fingers)
    return (
        f"Fig 3. From a fingertip's picture to CCI and EDA, {kind}: the untouched gel; the frame of the trial's "
        "firmest contact; their difference, scaled; the touch map of the loop's own reading. Green circle: the peak, "
        "where CCI is taken; blue line: the pixels that EDA counts. Both as shares of the calibrated press, as "
        f"the vest gets them. Trials {trials}."
    )


def _planner(analysis: Analysis) -> str:
    if not analysis.planner:
        return ""
    body = [
        [
            esc(PAPER_LABELS[row.metric]),
            esc(row.object),
            f"{row.reference:.2g} → {row.mean:.2g}",
            row.spread,
            "more than 30" if row.people is None else str(row.people),
            f"{100 * row.power_at_12:.0f}&nbsp;% ± {100 * row.error:.0f}",
        ]
        for row in analysis.planner
    ]
    head = ["metric", "object", "effect", "people differ", "people for 80 %", "power of 12"]
    note = (
        "If the effects were as large as seen here, uncorrected at 0.05, paired t on log sums. Effects "
        "seen in a small study are "
        "too large on average: plan for less. Other effects: <code>tega-teleop study power</code>."
    )
    return "<h2>The next study</h2>" + table(head, body, note)


def _details(analysis: Analysis) -> str:
    tests = [
        [
            esc(PAPER_LABELS[t.metric]),
            esc(t.object),
            t.level,
            esc(t.test),
            f"{t.n[0]}, {t.n[1]}",
            str(t.people),
            number(t.statistic),
            p_value(t.p),
            p_value(t.p_holm),
            esc(t.effect_name),
            with_interval(t.effect, t.low, t.high),
            esc(t.note),
        ]
        for t in analysis.tests
    ]
    head = [
        "metric",
        "object",
        "level",
        "test",
        "trials",
        "people",
        "statistic",
        "p",
        "Holm",
        "effect",
        "",
        "note",
    ]
    out = [
        "<h2>Everything</h2>",
        fold("All tests", table(head, tests, "Tests outside the family are exploratory.")),
    ]
    if analysis.couplings:
        rows = [
            [
                *(
                    esc(c.trial),
                    esc(c.object),
                    esc(c.condition),
                    c.signal.upper(),
                    str(c.samples),
                    number(c.n_eff, 1),
                ),
                *(
                    with_interval(c.r, c.low, c.high),
                    number(c.r_others),
                    p_value(c.p_others),
                    number(c.slope),
                ),
            ]
            for c in analysis.couplings
        ]
        head = ["trial", "object", "condition", "signal", "samples", "worth", "r", "others", "p", "answer"]
        note = (
            "Worth: independent samples; the interval goes by it. p: share of pairings with other trials "
            "that reach r."
        )
        out.append(fold("Correlation of each trial", table(head, rows, note)))
    sections = []
    of = {trial.id: trial for trial in analysis.trials}
    for cell in analysis.cells:
        rows = []
        for trial in (of[one] for one in cell.trials):
            duration = "–" if trial.duration_s is None else f"{trial.duration_s:.3f}"
            counts = [
                str(trial.slips),
                str(trial.deformations),
                str(trial.drops),
                "yes" if trial.success else "no",
            ]
            rows.append(
                [esc(trial.id), duration, *counts, f'<span class="small">{esc(_ranges(trial.events))}</span>']
            )
        head = ["trial", "time, s", "slips", "deformations", "drops", "success", "events"]
        title = f"{cell.object}, {cell.condition}"
        where = anchor_of(cell.object, cell.condition)
        sections.append(f'<h3 id="{where}">{esc(title)}</h3>' + table(head, rows, ""))
    return "".join(out) + "<h2>Trials</h2>" + "".join(sections)


def _ranges(events: Sequence[str]) -> str:
    """Shorten ``file:3 file:4 file:5`` to ``file:3–5``."""
    runs: list[tuple[str, int, int]] = []
    for event in events:
        path, _, number = event.rpartition(":")
        n = int(number)
        if runs and runs[-1][0] == path and runs[-1][2] == n - 1:
            runs[-1] = (path, runs[-1][1], n)
        else:
            runs.append((path, n, n))
    return ", ".join(f"{path}:{i}" + (f"–{j}" if j > i else "") for path, i, j in runs)
