"""The parts of a report's page on how far accounts agree, and on what participants answered."""

from __future__ import annotations

from tega.study.analyse import Analysis
from tega.study.lead.questions import QUESTIONS
from tega.study.markup import esc, number, table, with_interval

__all__ = ["scores_html"]

_TITLES = {
    question.item: f"{question.title}: 0 {question.left}, 100 {question.right}" for question in QUESTIONS
}


def scores_html(analysis: Analysis) -> str:
    """Return both sections; nothing where there is nothing to tell."""
    return _agreements(analysis) + _ratings(analysis)


def _agreements(analysis: Analysis) -> str:
    if not analysis.agreements:
        return ""
    body = [
        [
            esc(one.kind.replace("_", "-")),
            esc(one.a),
            esc(one.b),
            str(one.trials),
            f"{one.n_a}, {one.n_b}",
            number(one.f1),
            number(one.chance_f1),
            number(one.delay_s) + ("" if one.delay_sd_s is None else f" ± {one.delay_sd_s:.2f}"),
            number(one.kappa),
            with_interval(one.icc, one.icc_low, one.icc_high),
        ]
        for one in analysis.agreements
    ]
    head = [
        "event",
        "first",
        "second",
        "trials",
        "events",
        "F1",
        "by chance",
        "delay, s",
        "kappa",
        "ICC(A,1)",
    ]
    note = (
        f"Events within {analysis.agreements[0].tolerance_s:g} s are one. By chance: the second's events turned round "
        "within each trial. Delay: second less first, of matched events. Kappa: bins of a second with an event against "
        "those without; it depends on the bins. ICC: counts by trial, absolute agreement; near its limits where all "
        "trials are alike. Slips in all phases. Truth: the simulated bench's own. "
        "Detector: found in the signals, without looking for drops."
    )
    return "<h2>Who scored, and how far they agree</h2>" + table(head, body, note)


def _ratings(analysis: Analysis) -> str:
    if not analysis.ratings:
        return ""
    body = [
        [
            esc(_TITLES.get(one.item, one.item)),
            esc(one.condition),
            str(one.people),
            str(one.answers),
            f"{one.median:.0f}",
            f"{one.low:.0f} to {one.high:.0f}",
        ]
        for one in analysis.ratings
    ]
    head = ["question", "condition", "people", "answers", "median", "range"]
    note = (
        "Answers after blocks, 0 to 100; a mean for each person first. Raw NASA-TLX: mean of its six scales."
    )
    return "<h2>Workload and comfort</h2>" + table(head, body, note)
