"""LAPACK and BLAS on parts of one column-major front, in place and without holding Python's lock.

SciPy's own wrappers copy a part of a matrix and keep other threads waiting; the routines themselves, which SciPy offers
to Cython by address, do neither. All matrices are float64 and column-major; `n` is the leading dimension.
"""

import ctypes
from typing import Any

import numpy as np
from scipy.linalg import cython_blas, cython_lapack

from aatri.arrays import Float

# Argument lists of LAPACK: a matrix with its leading dimension.
# fmt: off

_L, _R, _N, _T = (ctypes.c_char(letter) for letter in (b"L", b"R", b"N", b"T"))


def _routine(module: Any, name: str, arguments: int) -> Any:
    """The routine behind a Cython capsule, as a function of that many pointers."""
    get_name = ctypes.pythonapi.PyCapsule_GetName
    get_name.restype, get_name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    get_pointer = ctypes.pythonapi.PyCapsule_GetPointer
    get_pointer.restype, get_pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    capsule = module.__pyx_capi__[name]
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(get_pointer(capsule, get_name(capsule)))


_potrf = _routine(cython_lapack, "dpotrf", 5)
_trtri = _routine(cython_lapack, "dtrtri", 6)
_trsm = _routine(cython_blas, "dtrsm", 11)
_trmm = _routine(cython_blas, "dtrmm", 11)
_syrk = _routine(cython_blas, "dsyrk", 10)
_symm = _routine(cython_blas, "dsymm", 12)
_gemm = _routine(cython_blas, "dgemm", 13)


DIVIDED = 128
"""Columns of a panel that are divided by the factor at once."""


def _int(value: int) -> Any:
    return ctypes.byref(ctypes.c_int(value))


def _real(value: float) -> Any:
    return ctypes.byref(ctypes.c_double(value))


def _at(matrix: Float, row: int, column: int) -> ctypes.c_void_p:
    return ctypes.c_void_p(matrix.ctypes.data + 8 * (row + column * matrix.shape[0]))


def cholesky_panel(F: Float, m: int) -> int:
    """Factorise the first m columns of a front and update the rest: F11 = L11 L11', L21 = F21 L11^-T, F22 -= L21 L21'.

    Parameters
    ----------
    F : (n, n) float64, column-major
        Lower triangle; overwritten by L11, L21 and the updated F22.
    m : int

    Returns
    -------
    int
        0, or the number (from 1) of the pivot that is not positive.
    """
    n, info = F.shape[0], ctypes.c_int(0)
    lda = _int(n)
    _potrf(ctypes.byref(_L), _int(m), _at(F, 0, 0), lda, ctypes.byref(info))
    if info.value == 0 and n > m:
        _divide(F, m)
        _syrk(ctypes.byref(_L), ctypes.byref(_N), _int(n - m), _int(m), _real(-1.0), _at(F, m, 0), lda,
              _real(1.0), _at(F, m, m), lda)
    return info.value


def _divide(F: Float, m: int) -> None:
    """F21 <- F21 L11^-T, block of columns by block: products with inverted diagonal blocks, twice as fast as dtrsm."""
    n, lda = F.shape[0], _int(F.shape[0])
    for first in range(0, m, DIVIDED):
        width = min(DIVIDED, m - first)
        if first:
            _gemm(ctypes.byref(_N), ctypes.byref(_T), _int(n - m), _int(width), _int(first), _real(-1.0),
                  _at(F, m, 0), lda, _at(F, first, 0), lda, _real(1.0), _at(F, m, first), lda)
        inverse, info = np.array(F[first : first + width, first : first + width], order="F"), ctypes.c_int(0)
        _trtri(ctypes.byref(_L), ctypes.byref(_N), _int(width), _at(inverse, 0, 0), _int(width), ctypes.byref(info))
        _trmm(ctypes.byref(_R), ctypes.byref(_L), ctypes.byref(_T), ctypes.byref(_N), _int(n - m), _int(width),
              _real(1.0), _at(inverse, 0, 0), _int(width), _at(F, m, first), lda)


def forward(L: Float, g: Float) -> None:
    """Forward substitution on a panel, in place: g1 <- L11^-1 g1, g2 <- g2 - L21 g1.

    Parameters
    ----------
    L : (n, m) float64, column-major
    g : (n,) float64
    """
    forward_columns(L, g.reshape((-1, 1), order="F"))


def backward(L: Float, x: Float) -> None:
    """Back substitution on a panel, in place: x1 <- L11^-T (x1 - L21' x2).

    Parameters
    ----------
    L : (n, m) float64, column-major
    x : (n,) float64
    """
    backward_columns(L, x.reshape((-1, 1), order="F"))


def forward_columns(L: Float, G: Float) -> None:
    """`forward` for several right-hand sides, the columns of G.

    Parameters
    ----------
    L : (n, m) float64, column-major
    G : (n, r) float64, column-major
    """
    (n, m), r = L.shape, G.shape[1]
    lda = _int(n)
    _trsm(ctypes.byref(_L), ctypes.byref(_L), ctypes.byref(_N), ctypes.byref(_N), _int(m), _int(r), _real(1.0),
          _at(L, 0, 0), lda, _at(G, 0, 0), lda)
    if n > m:
        _gemm(ctypes.byref(_N), ctypes.byref(_N), _int(n - m), _int(r), _int(m), _real(-1.0), _at(L, m, 0), lda,
              _at(G, 0, 0), lda, _real(1.0), _at(G, m, 0), lda)


def backward_columns(L: Float, X: Float) -> None:
    """`backward` for several right-hand sides, the columns of X.

    Parameters
    ----------
    L : (n, m) float64, column-major
    X : (n, r) float64, column-major
    """
    (n, m), r = L.shape, X.shape[1]
    lda = _int(n)
    if n > m:
        _gemm(ctypes.byref(_T), ctypes.byref(_N), _int(m), _int(r), _int(n - m), _real(-1.0), _at(L, m, 0), lda,
              _at(X, m, 0), lda, _real(1.0), _at(X, 0, 0), lda)
    _trsm(ctypes.byref(_L), ctypes.byref(_L), ctypes.byref(_T), ctypes.byref(_N), _int(m), _int(r), _real(1.0),
          _at(L, 0, 0), lda, _at(X, 0, 0), lda)


def panel_covariance(L: Float, covariance: Float) -> Float:
    """Covariance of a front from that of its boundary.

    With L11, L21 of the panel, G = L21 L11^-1 and S22 the covariance of the boundary,

        S21 = -S22 G,    S11 = L11^-T L11^-1 + G' S22 G

    Parameters
    ----------
    L : (n, m) float64, column-major
    covariance : (n - m, n - m) float64, column-major, symmetric

    Returns
    -------
    (n, n) float64, column-major, symmetric
    """
    n, m = L.shape
    S = np.zeros((n, n), order="F")
    inverse = np.array(L[:m], order="F")
    info = ctypes.c_int(0)
    _trtri(ctypes.byref(_L), ctypes.byref(_N), _int(m), _at(inverse, 0, 0), _int(m), ctypes.byref(info))
    inverse = np.asfortranarray(np.tril(inverse))
    if n == m:
        _syrk(ctypes.byref(_L), ctypes.byref(_T), _int(m), _int(m), _real(1.0), _at(inverse, 0, 0), _int(m),
              _real(0.0), _at(S, 0, 0), _int(n))
    else:
        G = np.array(L[m:], order="F")
        _trmm(ctypes.byref(_R), ctypes.byref(_L), ctypes.byref(_N), ctypes.byref(_N), _int(n - m), _int(m),
              _real(1.0), _at(inverse, 0, 0), _int(m), _at(G, 0, 0), _int(n - m))
        _symm(ctypes.byref(_L), ctypes.byref(_L), _int(n - m), _int(m), _real(-1.0), _at(covariance, 0, 0),
              _int(n - m), _at(G, 0, 0), _int(n - m), _real(0.0), _at(S, m, 0), _int(n))
        _syrk(ctypes.byref(_L), ctypes.byref(_T), _int(m), _int(m), _real(1.0), _at(inverse, 0, 0), _int(m),
              _real(0.0), _at(S, 0, 0), _int(n))
        _gemm(ctypes.byref(_T), ctypes.byref(_N), _int(m), _int(m), _int(n - m), _real(-1.0), _at(G, 0, 0),
              _int(n - m), _at(S, m, 0), _int(n), _real(1.0), _at(S, 0, 0), _int(n))
        S[m:, m:] = covariance
    below = np.tril(S[:m, :m], -1)
    S[:m, :m] = below + below.T + np.diag(np.diagonal(S)[:m])
    S[:m, m:] = S[m:, :m].T
    return S
