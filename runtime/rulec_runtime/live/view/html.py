"""The plant as a web page, with the finding first."""

import base64
import hashlib
from pathlib import Path
from string import Template

from rulec_runtime.live.episode import QUIET, Event
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.limits import BAR_ENDS, LATEST_EVENTS, SILENT, STATIC, TICK
from rulec_runtime.live.view.words import (
    Bar,
    Card,
    bars_of,
    cards,
    event_words,
    latest,
    lead,
    link,
    modules,
    overall,
    unjudged,
    unseen,
)
from rulec_runtime.report.document import STYLE, badge
from rulec_runtime.report.html_findings import REMARKS, card, degree_of, ground_of
from rulec_runtime.report.parts import Part, part_html
from rulec_runtime.report.text import Html, counted, safe

SCRIPT = Path(__file__).with_name("page.js").read_text(encoding="utf-8")
PAGE = Template(Path(__file__).with_name("page.html").read_text(encoding="utf-8"))
CSS = STYLE + Path(__file__).with_name("page.css").read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


POLICY = (
    f"default-src 'none'; script-src 'sha256-{_hash(SCRIPT)}'; style-src 'sha256-{_hash(CSS)}'; "
    "img-src data:; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
"""The browser runs only this script and this style, even if others are injected."""


def page_of(now: Now, age: float | None, main: str) -> str:
    """The whole page, in one file; it shows this moment even without scripts."""
    parts = {"look": CSS, "script": SCRIPT, "link": link_of(now, age), "main": main}
    names = {"title": safe(title_of(now)), "name": safe(now.title), "plant": safe(now.plant)}
    times = {"static": STATIC, "every": f"{1000 * TICK:.0f}", "silent": f"{1000 * SILENT:.0f}"}
    return PAGE.substitute(parts | names | times)


def title_of(now: Now) -> str:
    """Title of the window, which begins with the status."""
    symbol, letter, _ = overall(now)
    return f"{symbol} {letter} {now.plant}: {lead(now)}"


def link_of(now: Now, age: float | None) -> str:
    """The connection, and the age of the last row."""
    symbol, words = link(now)
    kind = "link" if now.connected else "link off"
    remark = f'<span class="remark">{safe(now.remark)}</span>' if now.remark else ""
    return (
        f'<p class="{kind}"><span>{symbol} {safe(words)}</span>'
        f"<span>{safe(latest(now, age))}</span><span>{counted(now.rows, 'row')}</span>{remark}</p>"
    )


def main_of(now: Now, seal: str) -> str:
    """Everything that changes, except the connection."""
    symbol, letter, meaning = overall(now)
    status = badge(letter) if letter else f'<span class="badge is-none">{symbol}</span>'
    found, meaning = cards(now), meaning[:1].upper() + meaning[1:]
    findings = "".join(_card(now, one, seal) for one in found if one.episode.kind != "blind")
    chips = "".join(
        f'<li><b>{safe(name)}</b> <span class="soft">{safe(title)}</span>{badge(one, True)}</li>'
        for name, title, one in modules(now)
    )
    events = "".join(_event(now, event) for event in now.past[:LATEST_EVENTS])
    past = f'<ol class="events">{events}</ol>' if events else ""
    blind = _blind(now, [one for one in found if one.episode.kind == "blind"], seal)
    return (
        f'<div class="status">{status}<p role="status"><strong>{safe(lead(now))}</strong>'
        f'<span class="soft">{"" if meaning == lead(now) else safe(meaning)}</span></p></div>'
        f'<div class="sides"><div>{findings}{_residuals(now)}</div>'
        f"<div>{_section('Modules', f'<ul class=modules>{chips}</ul>' if chips else '')}"
        f"{_section('Cannot be judged', blind)}{_section('Past events', past)}</div></div>"
    )


def key_of(episode: str) -> str:
    """An episode id for a form: the id itself may contain anything."""
    return hashlib.sha256(episode.encode("utf-8", "surrogatepass")).hexdigest()[:16]


def _section(title: str, body: str) -> str:
    return part_html(Part(title, [Html(body)])) if body else ""


def _card(now: Now, found: Card, seal: str) -> str:
    degree, _, ends = found.size.partition(" (")
    about = f", {found.meaning}" if found.meaning else ""
    action = Html(f'<span class="do">{safe(found.action)}</span>' if found.action else "")
    rows = {
        "What to do": action,
        "Degree": degree_of(degree, f"({ends}{about}") if degree else "",
        "Growth": found.episode.grows,
        "Seen": found.since,
        "Probability": found.probability,
        "Could also be": found.others,
    }
    why = ""
    if found.finding is not None and now.diagnosis is not None:
        ground = ground_of(now.diagnosis.ruleset, found.finding)
        key = key_of(found.episode.id)
        why = f'<details id="why-{key}"><summary>Why</summary>{ground}</details>'
    below = Html(why + _note(found, seal))
    return part_html(card(found.episode.status, found.title, rows.items(), below))


def _note(card: Card, seal: str) -> str:
    if card.acknowledged:
        return '<p class="soft noted">✓ acknowledged</p>'
    key = key_of(card.episode.id)
    return (
        '<form method="post" action="acknowledge">'
        f'<input type="hidden" name="seal" value="{safe(seal)}"/>'
        f'<input type="hidden" name="episode" value="{key}"/>'
        f'<button id="note-{key}">Acknowledge</button></form>'
    )


def _residuals(now: Now) -> str:
    found = bars_of(now)
    if found is None:
        return ""
    rows = "".join(_residual(bar) for bar in found.bars)
    body = f"<ul class=bars>{rows}</ul>" if rows else ""
    if found.smaller:
        body += f'<p class="soft after">and {found.smaller} smaller ones</p>'
    if found.missing:
        body += f'<p class="soft after">Not available: {safe(", ".join(found.missing))}</p>'
    return _section(found.title, body)


def _residual(bar: Bar) -> str:
    kind = "beyond" if bar.beyond else "within"
    value, words = bar.value.replace("-", "−"), bar.words
    return (
        f'<li class="{kind}"><span>{safe(bar.name)}</span>'
        f'<svg class="gauge" aria-hidden="true"><rect class="all" width="100%" height="100%"/>'
        f'<rect class="filled" width="{100 * bar.filled:.2f}%" height="100%"/>'
        f'<rect class="limit" x="{100 / BAR_ENDS:.2f}%" width="2" height="100%"/></svg>'
        f'<span class="num">{safe(value)} <span class="soft">{safe(bar.threshold)}</span></span>'
        f'<span class="words">{safe(words)}</span></li>'
    )


def _blind(now: Now, active: list[Card], seal: str) -> str:
    parts = [
        f'<div class="blind is-C"><p>{badge(c.episode.status, True)} {safe(c.title)} '
        f'<span class="soft">{safe(c.since)}</span></p>{_note(c, seal)}</div>'
        for c in active
    ]
    remarks = unjudged(now)
    parts += [
        f'<p>{safe(text)} <span class="soft">{safe(spans)}</span></p>'
        for text, spans in remarks[:REMARKS]
    ]
    if len(remarks) > REMARKS:
        parts.append(f'<p class="soft">and {counted(len(remarks) - REMARKS, "other remark")}</p>')
    if unseen(now):
        parts.append(f'<p class="soft">No reading shows: {safe(", ".join(unseen(now)))}</p>')
    return "".join(parts)


def _event(now: Now, event: Event) -> str:
    when, _, what, text = event_words(now, event)
    letter = "ok" if what in QUIET else event.episode.status
    noted = ' <span class="soft">✓ acknowledged</span>'
    return (
        f"<li><span>{badge(letter, True)}</span><span>"
        f'<span class="soft">{safe(when)} {safe(what)}</span>'
        f"<br/>{safe(text)}{noted if event.episode.id in now.acknowledged else ''}</span></li>"
    )
