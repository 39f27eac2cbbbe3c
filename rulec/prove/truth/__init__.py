"""Independent truth: recordings of plants, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `units`, `formulas` (in
tables), `streams` (random numbers), `sensors`, `recording` (columns and CSV), `smooth` (form
errors, coloured noise, drifts), `detection_limit` (detectability at best), `sealed` (the
form of a case and its answer), `kinds` (of cases), `settled` and `tanks` (cases of plants in
stationary operation, and of plants that store liquid). Everything is SI until a sensor reads it;
readings and CSV files are in trade units.
"""
