"""Trade units as multiples of SI units, and the type of every array here."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BAR = 1e5  # Pa
LITRE_PER_HOUR = 1e-3 / 3600.0  # m3/s
MILLILITRE = 1e-6  # m3
RPM = 1.0 / 60.0  # rev/s; also strokes per minute
MILLIMETRE = 1e-3  # m
ZERO_CELSIUS = 273.15  # K
