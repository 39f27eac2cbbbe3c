"""Points of real devices, and files that hold them."""

from __future__ import annotations

from pathlib import Path

NB = """\
Q [m3/h],H [m],eta [%],P2 [kW],P_el [kW],NPSHr [m],n [rpm]
1,33.25,1.9,4.755,5.149,2.19,2981
10,33.15,17.5,5.163,5.580,2.40,2979
20,33.01,31.8,5.641,6.087,2.59,2976
40,32.61,53.4,6.641,7.160,2.85,2971
60,31.82,67.9,7.651,8.258,3.08,2965
80,30.44,76.9,8.612,9.316,3.40,2959
100,28.22,81.1,9.464,10.27,3.94,2953
105,27.51,81.4,9.652,10.48,4.12,2952
108,27.05,81.4,9.761,10.60,4.24,2952
110,26.73,81.4,9.830,10.68,4.33,2951
114,26.07,81.1,9.961,10.83,4.51,2950
120,24.96,80.3,10.15,11.04,4.82,2949
130,22.85,77.6,10.41,11.34,5.43,2947
"""
"""Grundfos NB 65-160/157, product 97839240, curve tolerance ISO 9906:2012 grade 3B, as the maker's
Product Center gave it on 2026-10-02; water of 998.2 kg/m3."""


def written(folder: Path, text: str, name: str = "sheet.csv") -> str:
    """Path of a file with a text."""
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return str(file)


def rows() -> list[list[str]]:
    """Cells of the sheet, titles first."""
    return [line.split(",") for line in NB.splitlines()]
