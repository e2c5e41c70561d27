"""Fits the rule that a slip is seen by to trials whose truth is known.

A logistic rule over what the detector sees (:data:`tega.stages.events.settings.FEATURES` and its sisters), with a
penalty on its weights; over fingertips that read shear also over products of two of them, chosen one after another as
the one that lessens the error most. :func:`left_out` fits without some people and judges those, several times over.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tega.stages.events import DetectedEvent, Detector
from tega.stages.events.detector import Rise
from tega.stages.events.settings import FEATURES, HAND_FEATURES, SETTINGS, SHEAR_FEATURES, SINK_FEATURES, Rule
from tega_study.detecting import events_of
from tega_study.score import match_events

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_figures.check_events import KeptTrial

__all__ = ["N_PRODUCTS", "TOLERANCE_S", "SlipTrial", "fit", "left_out", "looks_of", "told_of"]

TOLERANCE_S = 0.5
"""As for video that is stepped through: nobody has to press a key here."""

N_PRODUCTS = 12
"""Of a rule that looks at shear."""

SINK_ENTER, SINK_LEAST_S = 0.75, 0.01
"""Of the rule of sinking fingertips: with people left out the fewest false ones at an F1 of 0.9 or more."""

_ONSET_S = 0.5
_ENTER = (0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7)
_LEAST_S = (0.05, 0.1, 0.15, 0.2)
_SINK_S = (0.0, 0.2)
_SOON_S = (0.0, 0.01, 0.02, 0.03, 0.05)


class _Looks(Detector):
    """Keeps what the slip's rule is given, and whether it is asked."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[float, tuple[float, ...], bool]] = []

    def _slip(self, t_s: float) -> list[DetectedEvent]:
        self._remember(t_s)
        self.seen.append(
            (t_s, self.features(t_s), self._settled(t_s) and self.may_slip and not self._lowered)
        )
        return []


class SlipTrial(NamedTuple):
    """A trial as the slip's rule sees it.

    Attributes:
        t_s: Times of the looks, seconds; shape ``(n,)``.
        features: What is seen, shape ``(n, features)``.
        asked: Whether the rule is asked, shape ``(n,)``.
        slips: 1 in the first half second of a slip; where fingertips sink in its first 0.2 s, so that it is told early.
            Shape ``(n,)``.
        used: Which looks are fitted: later ones of a slip are not. Shape ``(n,)``.
        truth_s: When slips began, seconds.
        person: Who.
        least_s: For how long a rule's share may have to last, seconds.
    """

    t_s: NDArray[np.float64]
    features: NDArray[np.float64]
    asked: NDArray[np.bool_]
    slips: NDArray[np.float64]
    used: NDArray[np.bool_]
    truth_s: tuple[float, ...]
    person: int
    least_s: tuple[float, ...] = _LEAST_S


def looks_of(kept: KeptTrial, *, hand: bool, sink: bool = False) -> SlipTrial:
    """Return what the slip's rule sees in a trial.

    Args:
        kept: The trial.
        hand: Whether hand and arm are measured.
        sink: Whether the hand's joints tell where the fingertips are, besides.
    """
    looks = _Looks()
    rows = [row if sink else row._replace(tips_mm=None) for row in kept.hand] if hand else []
    events_of(kept.touch, rows, detector=looks, shear=kept.shear)
    alone = SHEAR_FEATURES if kept.shear else FEATURES
    width = len((SINK_FEATURES if sink else HAND_FEATURES) if hand else alone)
    seen = [one for one in looks.seen if len(one[1]) == width]
    t_s = np.array([one[0] for one in seen])
    slips, near = np.zeros(len(seen)), np.zeros(len(seen), dtype=bool)
    for begin, end in kept.slipping:
        near |= (t_s >= begin - 0.1) & (t_s <= end + 0.3)
        before_s, after_s = _SINK_S if sink else (0.0, _ONSET_S)
        slips[(t_s >= begin + before_s) & (t_s <= min(end, begin + after_s))] = 1
    asked = np.array([one[2] for one in seen], dtype=bool)
    return SlipTrial(
        t_s,
        np.array([one[1] for one in seen]).reshape(-1, width),
        asked,
        slips,
        asked & (~near | (slips > 0)),
        tuple(begin for begin, _end in kept.slipping),
        kept.result.seed,
        _SOON_S if sink else _LEAST_S,
    )


def fit(
    trials: Sequence[SlipTrial], *, products: int = 0, penalty: float = 30.0, at: Rule | None = None
) -> Rule:
    """Fit the slip's rule: ridge-penalised logistic weights, then the threshold with the best F1 over these trials.

    Args:
        trials: What is seen of them.
        products: So many products of two features are looked at besides.
        penalty: On half the squared weights of standardised features.
        at: A rule whose threshold and time are taken instead, such as that of :func:`left_out`.
    """
    rule = _weighed(trials, products, penalty)
    if at is not None:
        return _shifted(rule._replace(enter=at.enter, least_s=at.least_s))
    shares = [_shares(rule, one) for one in trials]
    return _shifted(max(_tried(rule, trials), key=lambda one: _f1(trials, shares, one)))


def left_out(
    trials: Sequence[SlipTrial],
    *,
    products: int = 0,
    penalty: float = 30.0,
    parts: int = 5,
) -> tuple[Rule, list[list[float]]]:
    """Fit without a part of the people and see what is told of those, for each part; live.

    Returns:
        The threshold chosen over all that is told so (its weights are those of the last part), and when a slip is
        told with it in each trial, seconds.
    """
    people = sorted({one.person for one in trials})
    shares: list[NDArray[np.float64]] = [np.zeros(0)] * len(trials)
    rule = Rule(0.0, (), 0.5, 0.1)
    for part in range(parts):
        out = set(people[part::parts])
        rule = _weighed([one for one in trials if one.person not in out], products, penalty)
        for n, one in enumerate(trials):
            if one.person in out:
                shares[n] = _shares(rule, one)
    best = max(_tried(rule, trials), key=lambda one: _f1(trials, shares, one))
    return best, [_told(one, share, best) for one, share in zip(trials, shares, strict=True)]


def told_of(rule: Rule, one: SlipTrial) -> list[float]:
    """Return when a rule tells a slip of a trial, live, seconds."""
    return _told(one, _shares(rule, one), rule)


def _weighed(trials: Sequence[SlipTrial], products: int, penalty: float) -> Rule:
    x = np.concatenate([one.features[one.used] for one in trials])
    y = np.concatenate([one.slips[one.used] for one in trials])
    mean, sd = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
    z = (x - mean) / sd
    chosen: list[tuple[int, int]] = []
    first, second = np.triu_indices(z.shape[1])
    pairs = z[:, first] * z[:, second] if products else z[:, :0]
    of_pairs = pairs.mean(axis=0), np.maximum(pairs.std(axis=0), 1e-9)
    pairs = (pairs - of_pairs[0]) / of_pairs[1]
    at: list[int] = []
    b = _logistic_weights(z, y, penalty)
    for _ in range(products):
        share = _share(b, np.concatenate([z, pairs[:, at]], axis=1))
        gain = ((y - share) @ pairs) ** 2 / ((share * (1 - share)) @ pairs**2 + penalty)
        gain[at] = -1.0
        at.append(int(gain.argmax()))
        chosen.append((int(first[at[-1]]), int(second[at[-1]])))
        b = _logistic_weights(np.concatenate([z, pairs[:, at]], axis=1), y, penalty)
    # Back from standardised features to those that the detector has.
    bias, weights = float(b[0] - (b[1 : 1 + z.shape[1]] / sd) @ mean), b[1 : 1 + z.shape[1]] / sd
    raw: list[tuple[int, int, float]] = []
    for (i, j), n, weight in zip(chosen, at, b[1 + z.shape[1] :], strict=True):
        each = float(weight / of_pairs[1][n])
        bias -= each * float(of_pairs[0][n])
        both = each / float(sd[i] * sd[j])
        bias += both * float(mean[i] * mean[j])
        weights[i] -= both * mean[j]
        weights[j] -= both * mean[i]
        raw.append((i, j, round(both, 4)))
    return Rule(round(bias, 4), tuple(round(float(w), 4) for w in weights), 0.5, 0.1, tuple(raw))


def _logistic_weights(z: NDArray[np.float64], y: NDArray[np.float64], penalty: float) -> NDArray[np.float64]:
    from scipy.optimize import minimize

    def loss(b: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        u = b[0] + z @ b[1:]
        error = 1 / (1 + np.exp(-np.clip(u, -500, 500))) - y
        value = np.logaddexp(0, u).sum() - y @ u + penalty / 2 * float(b[1:] @ b[1:])
        return float(value), np.concatenate([[error.sum()], z.T @ error + penalty * b[1:]])

    found: NDArray[np.float64] = minimize(loss, np.zeros(z.shape[1] + 1), jac=True, method="L-BFGS-B").x
    return found


def _share(b: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    share: NDArray[np.float64] = 1 / (1 + np.exp(-np.clip(b[0] + z @ b[1:], -500, 500)))
    return share


def _shares(rule: Rule, one: SlipTrial) -> NDArray[np.float64]:
    u = rule.bias + one.features @ np.array(rule.weights)
    for i, j, weight in rule.products:
        u = u + weight * one.features[:, i] * one.features[:, j]
    share: NDArray[np.float64] = np.where(one.asked, 1 / (1 + np.exp(-np.clip(u, -500, 500))), 0.0)
    return share


def _shifted(rule: Rule) -> Rule:
    # The share is of looks; shifted so that an event that is just one has a confidence of a half.
    shift = math.log(rule.enter / (1 - rule.enter))
    return rule._replace(bias=round(rule.bias - shift, 4), enter=0.5)


def _tried(rule: Rule, trials: Sequence[SlipTrial]) -> list[Rule]:
    return [rule._replace(enter=enter, least_s=least_s) for enter in _ENTER for least_s in trials[0].least_s]


def _told(one: SlipTrial, share: NDArray[np.float64], rule: Rule) -> list[float]:
    rise = Rise("slip", rule, SETTINGS.rest_s, 0.0)
    rows: Iterable[tuple[float, float, bool]] = zip(
        one.t_s.tolist(), share.tolist(), one.asked.tolist(), strict=True
    )
    found = [rise.add(t_s, p, void=not asked) for t_s, p, asked in rows]
    return [event.known_s for event in found if event is not None]


def _f1(trials: Sequence[SlipTrial], shares: Sequence[NDArray[np.float64]], rule: Rule) -> float:
    events = matched = 0
    for one, share in zip(trials, shares, strict=True):
        slips = _told(one, share, rule)
        events += len(slips) + len(one.truth_s)
        matched += len(match_events(one.truth_s, slips, tolerance_s=TOLERANCE_S))
    return 2 * matched / max(events, 1)
