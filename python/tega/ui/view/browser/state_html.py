"""Write the page's style, by which the browser greys out stale parts, and its text about a run as HTML."""

from __future__ import annotations

from html import escape
from itertools import zip_longest
from typing import Final

from tega.loop.snapshot import LoopView
from tega.loop.touch import STALE_NS
from tega.runtime.words import number_text
from tega.ui.view.figures import GHOST_COLOUR
from tega.ui.view.run_state import (
    NO_NEWS,
    NO_NEWS_S,
    SILENT_NS,
    ContactLabels,
    device_rows,
    lines_beside,
    meaning,
)
from tega.ui.view.state import ViewState

NARROW_PX: Final = 1199
"""Up to this width of the window the panels stand below the scene: beside it they would leave it a strip."""

PHONE_EM: Final = 36
"""Up to this width viser shows one sheet for phones, and no panels."""

# Unless the run's state is painted afresh in time, the browser greys it and says for how long nothing was received.
# A frozen or killed program, a painter that failed and a run that stands still look the same.
_AGEING = f"""
@property --tega-age {{ syntax: "<integer>"; inherits: true; initial-value: 0 }}
@keyframes tega-age {{ to {{ --tega-age: 86400 }} }}
@keyframes tega-late {{ to {{ visibility: visible; max-height: 3em }} }}
@keyframes tega-grey {{ to {{ background: #6c757d }} }}
@keyframes tega-dim {{ to {{ filter: grayscale(1); opacity: 0.6 }} }}
.tega-lights {{ animation: tega-dim 1ms linear {NO_NEWS_S}s forwards }}
.tega-late {{ display: block; visibility: hidden; max-height: 0; overflow: hidden; color: #c92a2a; font-weight: bold;
  animation: tega-late 1ms linear calc({NO_NEWS_S}s - var(--tega-since)) forwards }}
.tega-late span {{ animation: tega-age 86400s linear calc(0s - var(--tega-since)) forwards }}
.tega-late span::after {{ counter-reset: age var(--tega-age); content: counter(age) " s" }}
.tega-ended {{ filter: grayscale(1); opacity: 0.5 }}
.tega-badge {{ animation: tega-grey 1ms linear calc({NO_NEWS_S}s - var(--tega-since)) forwards }}

.tega-sheet {{ display: block; box-sizing: border-box; width: 100%; height: auto; padding: 0 10px 8px }}
"""

STOP_MARK: Final = '<div class="tega-stop"></div>'
"""Stands before the button Stop, which the style finds by it."""

# A phone scrolls its sheet as a whole: there Stop stands at the lower edge of the window.
_STOP = f"""
@media (min-width: {PHONE_EM}.01em) {{
  [style*="overflow: hidden"]:has(.tega-stop) {{ overflow: clip !important; min-width: 0 }}
}}
div:has(> .tega-stop) + div {{ position: sticky; top: 0; z-index: 20; background: #fff; padding-top: 6px }}
@media (max-width: {PHONE_EM}em) {{
  div:has(> .tega-stop) + div {{ position: fixed; top: auto; bottom: 0; left: 0; right: 0; margin: 0 !important;
    padding: 8px; box-shadow: 0 -1px 4px #0003 }}
  div:has(> .tega-stop) + div button {{ height: 44px !important; width: 100% }}
}}
"""

# A phone's sheet stands below the scene, as wide as the window; viser's own is narrower and covers the scene.
_PHONE = f"""
.tega-phone {{ display: none; padding-top: 14px }}
@media (max-width: {PHONE_EM}em) {{
  .tega-phone {{ display: block }}
  .mantine-Paper-root:has(.tega-style), .mantine-Paper-root:has(.tega-style) [style*="width: 20em"] {{
    width: 100% !important; }}
  div:has(> .mantine-Paper-root .tega-style) {{ flex-direction: column }}
  .mantine-Paper-root:has(.tega-style) {{ position: static !important; flex-shrink: 0 }}
}}
"""

# Both panels open: the scene above, the panels below, half of the width each. With one of them folded or taken out, its
# place is viser's own again.
_BOTH_OPEN = ":has([data-dock-region-handle=left]):has([data-dock-region-handle=right])"
_NARROW = f"""
@media (min-width: {PHONE_EM}.01em) and (max-width: {NARROW_PX}px) {{
  [data-dock-root]{_BOTH_OPEN} > :first-child {{ left: 0 !important; right: 0 !important; bottom: 55% !important }}
  [data-dock-root]{_BOTH_OPEN} > [data-dock-region] {{ top: 45% !important; width: 50% !important }}
  [data-dock-root]{_BOTH_OPEN} > [data-dock-region] > div > [style*="position: relative"] {{ width: 100% !important }}
  [data-dock-root]{_BOTH_OPEN} > [style*="box-shadow"],
  [data-dock-root]{_BOTH_OPEN} [data-dock-region-resize] {{ display: none !important }}
}}
"""

STYLE: Final = f'<style class="tega-style">{_AGEING}{_STOP}{_PHONE}{_NARROW}</style>'
"""Style of the whole page, as an HTML element."""


_TYPE_COLOURS = {"none": "#6c757d", "focal": "#a85400", "broad": "#0b7285", "mixed": "#495057"}
_GREEN, _ORANGE, _RED = "#2a8339", "#c2410c", "#c92a2a"
_STATE_COLOURS = {"idle": "#946c00", "armed": "#0b7285", "active": _GREEN, "hold": _ORANGE, "stopped": _RED}
_ARM_COLOURS = {"idle": "#6c757d", "following": _GREEN, "holding": _ORANGE, "stopped": _RED}
PAUSED: Final = "#495057"
TILES: Final = 4
"""Fingers side by side in a line of captions and pictures."""

FONT: Final = "font-family:system-ui,sans-serif;font-size:12px;color:#343a40"

LEGEND: Final = (
    f'<div style="{FONT};font-size:11px;line-height:1.4;padding:0 10px;color:#6c757d">'
    'top: cameras; below: touch maps, <b style="color:#27a045">○</b> peak, '
    '<b style="color:#3b8cff">—</b> outline (EDA)<br>'
    f'scene: <b style="color:{GHOST_COLOUR}">blue, translucent:</b> the hand as commanded; red arrows: forces</div>'
)
"""Meaning of the colours, in small grey lines."""
# How often the run's state is painted afresh, also where nothing in it changes: the browser greys one that is not.
BEATS_PER_S: Final = 2


def run_state_html(
    view: LoopView,
    beat: int = 0,
    *,
    age_s: float = 0.0,
    problem: str = "",
    paused: bool = False,
    haptics: bool = True,
) -> str:
    """Return the run's state as HTML, as in the terminal, with a warning if no data arrives."""
    ended = view.state == "stopped"
    late, lines = "", []
    paused = paused and not ended
    if paused:
        lines.append(badge_html("PAUSED", PAUSED) + " <b>paused by the page's button</b>")
    elif not ended:
        words = f"{NO_NEWS} " + (f"{age_s:.0f} s" if age_s >= NO_NEWS_S else "<span></span>")
        displayed = ' style="visibility:visible;max-height:3em"' if age_s >= NO_NEWS_S else ""
        late = f'<b class="tega-late"{displayed}>{words}: the values below may be out of date</b>'
    if problem:
        lines.append(f'<span style="color:#c2410c">! {escape(problem)}</span>')
    if view.state:
        reason, alerts = lines_beside(view)
        if not paused:
            ageing = "" if ended else ' class="tega-badge"'
            badge = badge_html(view.state.upper(), _STATE_COLOURS[view.state], ageing)
            lines.append(f"{badge} {escape(meaning(view))}")
        if not haptics and not ended:
            lines.append(badge_html("HAPTICS OFF", PAUSED) + " switched off on this page: every motor rests")
        if reason:
            lines.append(f"<b>{escape(reason)}</b>")
        lines += [f'<span style="color:#c2410c">! {escape(alert)}</span>' for alert in alerts]
    style = f"--tega-since:{age_s:.1f}s;{FONT};margin:4px 10px;line-height:1.6"
    return f'<div data-beat="{beat}" style="{style}">{late}{"<br>".join(lines)}</div>'


def badge_html(text: str, colour: str, more: str = "") -> str:
    """Return a word on a coloured ground."""
    return f'<b{more} style="background:{colour};color:#fff;padding:1px 8px;border-radius:3px">{text}</b>'


def lights_html(state: ViewState) -> str:
    """Show a light for each part: green if well, orange at a fault or silence, grey without it; each has its shape."""
    loop = state.loop
    ended = loop.state == "stopped"
    seen: dict[str, bool | None] = {}
    for finger in loop.fingers:
        contact = loop.contacts.get(finger)
        seen[finger] = None if contact is None else state.t_ns - contact.t_ns <= STALE_NS
    seen["muscles"] = None if loop.intent is None else state.t_ns - loop.intent.t_ns <= SILENT_NS
    seen["vest"] = None if loop.vest is None else "vest" not in loop.troubled
    seen["hand"] = None if loop.angles_rad is None and state.poses is None else True
    if "hand" in loop.devices:
        seen["hand"] = loop.angles_rad is not None and "hand's link" not in loop.troubled
    if loop.arm or loop.seen_arm is not None:
        seen["arm"] = loop.seen_arm is not None and loop.seen_arm.state != "stopped"
    if loop.link:
        seen["link"] = "link" not in loop.troubled
    if ended:
        seen = dict.fromkeys(seen)
    words = {True: (_GREEN, "●", "well"), False: (_ORANGE, "▲", "fault"), None: ("#6c757d", "○", "absent")}
    cells = " ".join(
        f'<span style="white-space:nowrap" title="{name}: {word}">'
        f'<b style="color:{colour}" role="img" aria-label="{word}">{sign}</b> {name}</span>'
        for name, (colour, sign, word) in ((name, words[well]) for name, well in seen.items())
    )
    # A new element each time, so that the browser counts again from when it last received something.
    return (
        f'<div class="tega-lights" data-t="{state.t_ns}" '
        f'style="{FONT};font-size:11px;margin:2px 10px;line-height:1.6">'
        f"{cells}</div>"
    )


def arm_html(view: LoopView) -> str:
    """Return the arm's state as HTML, in the style of the run's; empty without an arm."""
    style = f"{FONT};margin:4px 10px;line-height:1.6"
    if (arm := view.seen_arm) is None:
        return f'<div style="{style}"><b>arm</b> {escape(view.arm)}</div>' if view.arm else ""
    health = arm.health
    took = "" if health.success_rate is None else f" · robot took {100 * health.success_rate:.0f} %"
    lines = (
        f"{badge_html(f'ARM {arm.state.upper()}', _ARM_COLOURS[arm.state])} {escape(arm.reason)}",
        f"{arm.switches} · hand at {arm.place}",
        f'<span style="color:#6c757d">the arm\'s loop: {escape(arm.phase)}, {health.rate_hz:.0f} Hz, worst '
        f"{health.worst_ms:.0f} ms, {health.refused} commands refused{took}</span>",
    )
    return f'<div style="{style}">{"<br>".join(lines)}</div>'


def status_html(state: ViewState) -> str:
    """List the lines of text of a moment, two pairs a line."""
    loop = state.loop
    rows = {"time": f"{state.t_ns / 1e9:.1f} s", **state.rows}
    more = {"touch": loop.newest_event, "reflex": loop.reflex, "vest link": loop.vest_condition}
    rows |= {name: text for name, text in more.items() if text}
    rows |= {name.replace("_", " "): seen.words(name) for name, seen in loop.inputs.items()}
    pairs = [
        f'<td style="color:#6c757d;padding-right:8px">{escape(name)}</td>'
        f'<td style="padding-right:14px"><b>{escape(text)}</b></td>'
        for name, text in rows.items()
    ]
    # Two pairs a line, in columns: the first half on the left.
    half = (len(pairs) + 1) // 2
    lines = "".join(
        f"<tr>{left}{right}</tr>" for left, right in zip_longest(pairs[:half], pairs[half:], fillvalue="")
    )
    # Muscles as decoded, hand as commanded and reported, and vest as sent, a line each.
    devices = "".join(
        f'<tr><td style="color:#6c757d;padding-right:8px;vertical-align:top">{name}</td>'
        f'<td colspan="3"><b>{escape(text)}</b></td></tr>'
        for name, text in device_rows(loop).items()
    )
    ended = ' class="tega-ended"' if loop.state == "stopped" else ""
    return f'<table{ended} style="{FONT};margin:2px 8px;line-height:1.5">{devices}{lines}</table>'


def captions_html(state: ViewState, labels: ContactLabels) -> str:
    """Return the contact of each finger as a caption under its name, four a line."""
    cells = []
    for finger in state.loop.fingers:
        contact = state.loop.contacts.get(finger)
        if contact is None:
            text = '<span style="color:#6c757d">no sensor</span>'
        elif state.t_ns - contact.t_ns > STALE_NS:
            text = '<b style="color:#a85400">silent:</b><br>no fresh<br>picture'
        else:
            kind = labels.name(contact)
            word, depth = "no contact" if kind == "none" else kind, ""
            if kind != "none" and contact.depth_mm is not None:
                depth = f" {number_text(contact.depth_mm, decimals=2)} mm"
            text = (
                f"CCI {contact.cci_norm:.2f}<br>EDA {contact.eda_norm:.2f}<br>"
                '<span style="white-space:nowrap;font-size:11px">'
                f'<b style="color:{_TYPE_COLOURS[kind]}">{word}</b>{depth}</span>'
            )
        cells.append(
            '<td style="width:25%;text-align:center;vertical-align:top;line-height:1.35">'
            f"<b>{finger}</b><br>{text}</td>"
        )
    style = f"{FONT};width:100%;table-layout:fixed;margin-top:-10px;padding:0 8px"
    lines = "</tr><tr>".join("".join(cells[k : k + TILES]) for k in range(0, len(cells), TILES))
    return f'<table style="{style}"><tr>{lines}</tr></table>'


def rates_html(rates_hz: dict[str, float], latency: str = "") -> str:
    """List the measured rates, and the latency of touch and motion."""
    rates = " · ".join(f"{escape(name)} {rate:.0f} Hz" for name, rate in rates_hz.items())
    message = f"{rates}<br>{escape(latency)}" if latency else rates
    return f'<div style="{FONT};font-size:11px;color:#6c757d;padding:2px 10px">{message}</div>'
