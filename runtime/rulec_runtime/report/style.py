"""How a report looks: on a screen by day and night, on a telephone, and on A4.

Colours of series are after Okabe and Ito (2008), told apart by all common kinds of colour vision;
each series has its own stroke as well.
"""

from __future__ import annotations

STYLE = """
:root { color-scheme: light dark; --paper: #fff; --ink: #1c1f23; --soft: #5d646d;
  --rule: #d9dde2; --grid: #e9ecef; --wash: #f4f6f8; --zero: #d9e8f0; --grey: #efefef;
  --c0: #0072b2; --c1: #d55e00; --c2: #007f5f; --c3: #a8558a; --c4: #8a6100; --c5: #50565d;
  --F: #d55e00; --C: #e69f00; --S: #f0c800; --M: #0072b2; --ok: #009e73; --alarm: #c24e00; }
@media screen and (prefers-color-scheme: dark) { :root { --paper: #14171a; --ink: #e4e7ea;
  --soft: #9aa3ac; --rule: #353b42; --grid: #262b30; --wash: #1c2024; --zero: #1e3642;
  --grey: #24282d; --c0: #56b4e9; --c1: #ff8f3d; --c2: #2fc79d; --c3: #dd94bf; --c4: #e6b94c;
  --c5: #b4bbc2; --M: #56b4e9; --alarm: #ff8f3d; } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0 auto; max-width: 54rem; padding: 2.5rem 1.5rem 4rem; background: var(--paper);
  color: var(--ink); font: 1rem/1.5 system-ui, "Segoe UI", "Helvetica Neue", "Liberation Sans",
  Arial, sans-serif; font-variant-numeric: tabular-nums; overflow-wrap: break-word; }
h1, h2, h3, p, dl, dd, figure, table { margin: 0; }
h1 { font-size: 1.05rem; font-weight: 600; }
h2 { margin: 3rem 0 1rem; padding-bottom: .3rem; border-bottom: 1px solid var(--rule);
  font-size: 1.25rem; font-weight: 600; letter-spacing: -.01em; }
h3 { font-size: 1.05rem; font-weight: 600; line-height: 1.35; }
.soft, .key, .below { color: var(--soft); }
header { display: flex; flex-wrap: wrap; justify-content: space-between; gap: 0 2rem;
  padding-bottom: .6rem; border-bottom: 1px solid var(--rule); font-size: .9rem; }
.status { display: flex; gap: 1rem; align-items: center; margin: 1.8rem 0 1.4rem; }
.badge { flex: none; display: inline-grid; place-items: center; width: 3.2rem; height: 3.2rem;
  border: 3px solid var(--of); border-radius: .4rem; font-size: 1.15rem; font-weight: 700;
  white-space: nowrap; }
.badge.small { width: auto; height: auto; padding: 0 .35rem; border-width: 2px;
  border-radius: .25rem; font-size: .85rem; }
.status strong { display: block; font-size: 1.6rem; font-weight: 600; line-height: 1.2;
  letter-spacing: -.015em; }
.is-F { --of: var(--F); } .is-C { --of: var(--C); } .is-S { --of: var(--S); }
.is-M { --of: var(--M); } .is-ok { --of: var(--ok); }
.finding { margin: 1.2rem 0; padding: .9rem 1.1rem 1rem; background: var(--wash);
  border-left: 4px solid var(--of, var(--rule)); border-radius: 0 .3rem .3rem 0; }
dl { display: grid; grid-template-columns: 9.5rem 1fr; gap: .3rem 1rem; margin-top: .7rem; }
dt { color: var(--soft); }
.degree { font-size: 1.15rem; font-weight: 600; }
table { border-collapse: collapse; font-size: .9rem; line-height: 1.35; }
th { font-weight: 600; text-align: left; }
th, td { padding: .28rem .8rem .28rem 0; vertical-align: baseline; }
thead th { color: var(--soft); font-weight: 400; border-bottom: 1px solid var(--rule); }
tbody tr + tr > * { border-top: 1px solid var(--grid); }
.num { text-align: right; white-space: nowrap; }
.mid { text-align: center; }
.agrees { color: var(--c2); } .contradicts { color: var(--alarm); font-weight: 600; }
.weaker, .hidden, .absent { color: var(--soft); }
.scroll { overflow-x: auto; }
.remarks { grid-template-columns: 1fr 2fr; }
.evidence > * + * { margin-top: 1rem; }
.evidence + .evidence, .facts h3 { margin-top: 2.2rem; }
figure { margin: 0 0 2.6rem; }
figure.narrow { max-width: 34rem; }
.key { margin-top: .1rem; font-size: .85rem; }
figcaption { margin-top: .7rem; }
.plot { padding: 2.1rem 6.2rem 0 3.6rem; }
.plot + .plot { padding-top: 1.75rem; }
.narrow .plot { padding-right: 1rem; }
.below { margin-top: 1.35rem; font-size: .8rem; text-align: right; }
.panel { display: block; width: 100%; overflow: visible; font-size: 12px; }
.data { overflow: hidden; }
.panel text { fill: var(--soft); }
.panel .title { fill: var(--ink); font-size: 12.5px; }
.grid { stroke: var(--grid); } .grid.zero { stroke: var(--soft); stroke-opacity: .6; }
.tick.y { text-anchor: end; dominant-baseline: central; } .tick.x { text-anchor: middle; }
.panel .name { dominant-baseline: central; font-size: 13px; font-weight: 600; }
.value { text-anchor: middle; } .panel .note { dominant-baseline: central; }
.panel .value, .panel .loud { fill: var(--ink); font-weight: 600; }
.curve { fill: none; stroke: var(--of); stroke-width: 1.6; stroke-linejoin: round;
  stroke-linecap: round; vector-effect: non-scaling-stroke; }
.band { fill: var(--of); fill-opacity: .17; stroke: none; }
.mark { fill: var(--of); } .mark .open { fill: none; }
.s0 { --of: var(--c0); } .s1 { --of: var(--c1); } .s2 { --of: var(--c2); }
.s3 { --of: var(--c3); } .s4 { --of: var(--c4); } .s5 { --of: var(--c5); }
.panel .name { fill: var(--of); }
.curve.s1 { stroke-dasharray: 7 4; } .curve.s2 { stroke-dasharray: 2 3.5; }
.curve.s3 { stroke-dasharray: 10 3 2 3; } .curve.s4 { stroke-dasharray: 14 5; }
.curve.s5 { stroke-dasharray: 4 3; }
.plain { --of: var(--ink); } .curve.plain { stroke-width: 1.1; }
.fired { --of: var(--alarm); } .truth { --of: var(--ink); }
.curve.truth { stroke-dasharray: 5 4; stroke-width: 1.2; }
.bar { stroke-opacity: .55; }
.band.zero, .band.unjudged { fill: var(--zero); fill-opacity: 1; }
.band.unjudged { fill: var(--grey); }
.band.located { fill: var(--c4); fill-opacity: .13; } .band.heldout { fill: var(--soft);
  fill-opacity: .55; }
.curve.dots { stroke-width: 3.6; stroke-opacity: .5; stroke-dasharray: none; }
.wide { width: 50%; min-width: 8rem; }
.meter { display: block; height: .75rem; min-width: 1px; border-radius: 2px;
  background: var(--c0); } .after { margin-top: 1rem; }
use { stroke: var(--paper); stroke-width: .8; }
.mark.fired use[href="#cross"] { stroke: var(--of); stroke-width: 1.8; }
.shares td, .shares thead th + th, .matrix td, .matrix thead th { text-align: center; }
.shares td { min-width: 3.6rem; padding: .28rem .4rem;
  background: color-mix(in srgb, var(--c0) calc(var(--tint, 0%) * .55), transparent); }
.shares .total > *, .shares td:last-child { color: var(--soft); background: none; }
.shares thead tr:first-child th { border: 0; text-align: center; }
.matrix { font-size: .8rem; }
.matrix th, .matrix td { padding: .22rem .45rem; }
.matrix tbody th { position: sticky; left: 0; padding-left: .5rem; background: var(--paper);
  font-weight: 400; white-space: nowrap; }
.matrix b { font-size: 1.05rem; line-height: 1; }
.matrix small { display: block; color: var(--soft); }
.matrix .found > * { background: color-mix(in srgb, var(--of) 16%, var(--paper)); }
.matrix .found th { font-weight: 700; box-shadow: inset 4px 0 var(--of); }
.facts dl:not(.remarks) { grid-template-columns: 11rem 1fr; font-size: .9rem; }
.facts dd + dd { grid-column: 2; }
.symbols { position: absolute; width: 0; height: 0; }
@media (max-width: 40rem) {
  body { padding: 1.2rem 1rem 3rem; }
  dl, .remarks, .facts dl:not(.remarks) { grid-template-columns: 1fr; gap: 0; }
  .scroll table { width: max-content; }
  figure:not(.narrow) .mark .odd { display: none; }
  dt { margin-top: .5rem; } .facts dd + dd { grid-column: 1; } .status strong { font-size: 1.3rem; }
  .plot { padding-left: 2.7rem; padding-right: 4.6rem; } .panel, .panel .title { font-size: 11px; }
  .panel .name { font-size: 11.5px; } .odd { display: none; } }
@media print {
  @page { size: A4; margin: 16mm 15mm; }
  html { font-size: 9.5pt; }
  body { max-width: none; padding: 0; print-color-adjust: exact;
    -webkit-print-color-adjust: exact; }
  #time .plot, #detail .plot { padding-right: 7.4rem; }
  .panel, .panel .title { font-size: 10.5px; } .panel .name { font-size: 11px; }
  h2, h3, .key { break-after: avoid; } h2 { margin-top: 2rem; }
  figure, .finding, tr { break-inside: avoid; }
  .tall { break-inside: auto; } .tall .plot { break-inside: avoid; }
  .scroll { overflow: visible; } }
"""
