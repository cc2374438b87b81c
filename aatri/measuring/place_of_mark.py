"""Where a fiducial mark lies in a scan, as other marks of it tell: z = a w + b, a similarity of complex numbers.

w is the calibrated place or, as y counts down in the scan, its conjugate: a film lies in a scanner on either side. Two
marks fit both; then it is taken to lie the right way up.
"""

import numpy as np


def place_of_mark(film: complex, others: list[tuple[complex, complex]]) -> complex | None:
    """The place of a mark in the scan, px; None with fewer than two other marks.

    Parameters
    ----------
    film : complex
        Its calibrated place, mm, y up.
    others : list of (complex, complex)
        Calibrated places of other marks, and where they were measured, px, y down.
    """
    if len(others) < 2:
        return None
    w, z = np.array(others).T
    fits = []
    for side in (np.conj, np.asarray):
        A = np.column_stack([side(w), np.ones(len(w))])
        x = np.linalg.lstsq(A, z, rcond=None)[0]
        fits.append((float(np.abs(A @ x - z).max()), complex(x[0] * side(film) + x[1])))
    upright, mirrored = fits
    return mirrored[1] if len(others) > 2 and mirrored[0] < upright[0] else upright[1]
