"""LAPACK and BLAS on parts of one column-major front, in place and without holding Python's lock.

SciPy's own wrappers copy a part of a matrix and keep other threads waiting; the routines themselves, which SciPy offers
to Cython by address, do neither. All matrices are float64 and column-major; `n` is the leading dimension.
"""

import contextlib
import ctypes
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from llvmlite.binding import get_host_cpu_features
from scipy.linalg import cython_blas, cython_lapack

from aatri.arrays import Float

# Argument lists of LAPACK: a matrix with its leading dimension.
# fmt: off

_L, _R, _N, _T = (ctypes.byref(ctypes.c_char(letter)) for letter in (b"L", b"R", b"N", b"T"))
_MINUS_ONE, _ZERO, _ONE = (ctypes.byref(ctypes.c_double(value)) for value in (-1.0, 0.0, 1.0))


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


def _has_avx512() -> bool:
    """Whether the processor has it; False where nobody can tell."""
    with contextlib.suppress(RuntimeError):
        return bool(get_host_cpu_features().get("avx512f"))
    return False


BY_INVERSES = _has_avx512()
"""Panels are divided by inverted diagonal blocks. With AVX-512 that is twice as fast as dtrsm of OpenBLAS; without it
dtrsm takes a third to a half of the time in fronts of 160 to 320 rows, and nine tenths in those of 1,500."""

DIVIDED = 128
"""Columns of a panel that are divided by the factor at once."""


@lru_cache(maxsize=4096)
def _int(value: int) -> Any:
    """A number by address; the routines only read it."""
    return ctypes.byref(ctypes.c_int(value))


def _at(matrix: Float, row: int, column: int) -> int:
    return _places(matrix)(row, column)


def _places(matrix: Float) -> Callable[[int, int], int]:
    """Addresses in a matrix, whose own is asked for once, as that takes a microsecond."""
    start, step = matrix.ctypes.data, 8 * matrix.shape[0]
    return lambda row, column: start + 8 * row + step * column


def cholesky_panel(F: Float, m: int) -> int:
    """Factorise the first m columns of a front and update the rest: F11 = L11 L11', L21 = F21 L11^-T, F22 -= L21 L21'.

    Parameters
    ----------
    F : (n, n) float64, column-major
        Lower triangle; overwritten by L11, L21 and the updated F22.

    Returns
    -------
    int
        0, or the number (from 1) of the pivot that is not positive.
    """
    n, info = F.shape[0], ctypes.c_int(0)
    at = _places(F)
    lda = _int(n)
    _potrf(_L, _int(m), at(0, 0), lda, ctypes.byref(info))
    if info.value == 0 and n > m:
        _divide(F, m)
        _syrk(_L, _N, _int(n - m), _int(m), _MINUS_ONE, at(m, 0), lda,
              _ONE, at(m, m), lda)
    return info.value


def _divide(F: Float, m: int) -> None:
    """F21 <- F21 L11^-T, at once, or block of columns by block: products with inverted diagonal blocks."""
    n, lda = F.shape[0], _int(F.shape[0])
    at = _places(F)
    if not BY_INVERSES:
        _trsm(_R, _L, _T, _N, _int(n - m), _int(m), _ONE,
              at(0, 0), lda, at(m, 0), lda)
        return
    for first in range(0, m, DIVIDED):
        width = min(DIVIDED, m - first)
        if first:
            _gemm(_N, _T, _int(n - m), _int(width), _int(first), _MINUS_ONE,
                  at(m, 0), lda, at(first, 0), lda, _ONE, at(m, first), lda)
        inverse, info = np.array(F[first : first + width, first : first + width], order="F"), ctypes.c_int(0)
        _trtri(_L, _N, _int(width), _at(inverse, 0, 0), _int(width), ctypes.byref(info))
        _trmm(_R, _L, _T, _N, _int(n - m), _int(width),
              _ONE, _at(inverse, 0, 0), _int(width), at(m, first), lda)


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
    of_L = _places(L)
    of_G = _places(G)
    _trsm(_L, _L, _N, _N, _int(m), _int(r), _ONE,
          of_L(0, 0), lda, of_G(0, 0), lda)
    if n > m:
        _gemm(_N, _N, _int(n - m), _int(r), _int(m), _MINUS_ONE, of_L(m, 0), lda,
              of_G(0, 0), lda, _ONE, of_G(m, 0), lda)


def backward_columns(L: Float, X: Float) -> None:
    """`backward` for several right-hand sides, the columns of X.

    Parameters
    ----------
    L : (n, m) float64, column-major
    X : (n, r) float64, column-major
    """
    (n, m), r = L.shape, X.shape[1]
    lda = _int(n)
    of_L = _places(L)
    of_X = _places(X)
    if n > m:
        _gemm(_T, _N, _int(m), _int(r), _int(n - m), _MINUS_ONE, of_L(m, 0), lda,
              of_X(m, 0), lda, _ONE, of_X(0, 0), lda)
    _trsm(_L, _L, _T, _N, _int(m), _int(r), _ONE,
          of_L(0, 0), lda, of_X(0, 0), lda)


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
    _trtri(_L, _N, _int(m), _at(inverse, 0, 0), _int(m), ctypes.byref(info))
    inverse = np.asfortranarray(np.tril(inverse))
    if n == m:
        _syrk(_L, _T, _int(m), _int(m), _ONE, _at(inverse, 0, 0), _int(m),
              _ZERO, _at(S, 0, 0), _int(n))
    else:
        G = np.array(L[m:], order="F")
        _trmm(_R, _L, _N, _N, _int(n - m), _int(m),
              _ONE, _at(inverse, 0, 0), _int(m), _at(G, 0, 0), _int(n - m))
        _symm(_L, _L, _int(n - m), _int(m), _MINUS_ONE, _at(covariance, 0, 0),
              _int(n - m), _at(G, 0, 0), _int(n - m), _ZERO, _at(S, m, 0), _int(n))
        _syrk(_L, _T, _int(m), _int(m), _ONE, _at(inverse, 0, 0), _int(m),
              _ZERO, _at(S, 0, 0), _int(n))
        _gemm(_T, _N, _int(m), _int(m), _int(n - m), _MINUS_ONE, _at(G, 0, 0),
              _int(n - m), _at(S, m, 0), _int(n), _ONE, _at(S, 0, 0), _int(n))
        S[m:, m:] = covariance
    below = np.tril(S[:m, :m], -1)
    S[:m, :m] = below + below.T + np.diag(np.diagonal(S)[:m])
    S[:m, m:] = S[m:, :m].T
    return S
