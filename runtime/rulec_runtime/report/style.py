"""How a report looks: on a screen by day and night, on a telephone, and on A4.

Colours of series are after Okabe and Ito (2008), told apart by all common kinds of colour vision;
each series has its own stroke as well.
"""

from __future__ import annotations

from pathlib import Path

STYLE = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
