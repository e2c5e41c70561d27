"""The words of a report that are the same in all of them."""

from __future__ import annotations

__all__ = ["ALONE", "METHODS", "STYLE"]

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 2rem auto; padding: 0 1rem; color: #111;
  background: #fff }
h1, h2, h3 { line-height: 1.2 } h2 { margin-top: 2.2rem; border-bottom: 1px solid #bbb }
.banner { border: 2px solid #b3541e; background: #fff4ea; padding: .6rem 1rem; font-weight: 600 }
.wide { overflow-x: auto } table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums }
caption { caption-side: bottom; text-align: left; font-size: .87em; color: #333; padding-top: .4rem }
th, td { padding: .22rem .6rem; text-align: left; border-bottom: 1px solid #ddd; vertical-align: top }
thead th { border-bottom: 2px solid #555; font-weight: 600 }
.small { font-size: .8em; color: #444 } a { color: #0b4f8a } figure { margin: 1.2rem 0 } img { max-width: 100% }
figcaption { font-size: .87em; color: #333 } summary { cursor: pointer; padding: .3rem 0 } code { font-size: .9em }
td:first-child { white-space: nowrap }
.mark.told { padding: 0 .35em; border-radius: .2em; font-weight: 600 }
.mark.yes { background: #cfe3f5 } .mark.no { background: #f7d8bd }
@page { size: A4; margin: 18mm }
@media print { body { margin: 0; max-width: none; font-size: 10pt }
  figure, tr { break-inside: avoid } thead { display: table-header-group } }
"""

ALONE = (
    "r: Pearson at lag 0 over 0.1 s cells, averaged by Fisher's z over each person's trials, then over "
    "people. A hand that closes raises touch whether or not anybody answers it, so r, its sign and its "
    "lag cannot show that users responded: an operator who ignores touch has a high r as well. "
    "What could show it: a lower r or a more negative answer with the vest than without (next table), "
    "and, alone conclusive, a vest whose signal is changed at random moments. Other trials' touch: r of a "
    "trial's pose with the touch of the same person's other trials of that object and condition. Answer: "
    "change of the pose within 0.3 s for a unit of touch 0.4 s before."
)

METHODS = """
<h2>How it was computed</h2>
<ul>
<li><b>As printed.</b> Mann-Whitney U over trials, two-sided: exact where no two values are equal, else the
normal approximation with corrections for ties and continuity; beside it the exact p given the ties. With counts
the two can differ much. Interval of the rank-biserial
correlation: Newcombe's method 5; of the median difference (Hodges-Lehmann): from the distribution of U.</li>
<li><b>These trials.</b> Conditions exchanged within each person in all ways; holds for these people's trials,
and takes a person's trials as exchangeable.</li>
<li><b>People.</b> Times: paired t on each person's mean log time. A mixed model with a random intercept has the same
estimate in a balanced design but finds effects that are not there when people differ in theirs, and one with
random slopes rarely converges.
Counts: ratio of means with people as clusters (Poisson GEE in closed form, bias-reduced standard error, t with
n − 1 degrees of freedom), p from all changes of sign of people's differences. Five people can reach no p below
0.0625 that way, so none is given.</li>
<li><b>Adjusted.</b> Generalised estimating equations (statsmodels) with the log of a trial's place in the
session beside the condition: what remains once learning and tiring are taken out. A sensitivity, not a second
chance.</li>
<li><b>Holm</b> over the tests that the plan names. Everything else is exploratory.</li>
<li><b>Times of failed trials</b> stay in, as they ended. A dropped object ends a trial early, so a
shorter mean can be the worse one: the mean over successes stands beside it.</li>
</ul>
"""
