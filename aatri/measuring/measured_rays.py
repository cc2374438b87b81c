"""Measured coordinates as an adjustment has them: reduced by interior orientation and corrections, held against points.

    v = model(u; c, x0, y0, lens) - reduced(m)         u: a point in image axes, m: a measurement

The interior orientation of each image and the corrections are those of the run, parameters of cameras and image errors
of a self-calibration, and what the fiducial marks of a film leave open, those that it found.
"""

import numpy as np
from scipy.interpolate import RectBivariateSpline

from aatri.adapters.interior.photo_coordinates import measured_to_photo
from aatri.adapters.refinement.corrections import earth_correction, lens_correction
from aatri.adapters.refinement.heights import stations_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.models import calibration
from aatri.geometry.plane_transformations import MOST_PARAMETERS, open_basis
from aatri.observations.poses import CAMERA, FILM

STEPS, SETTLED_MM = 50, 1e-6
"""Of the inversion of lenses."""


class MeasuredRays:
    """How the images of a run see."""

    def __init__(self, block: Block, image_points: ImagePoints, solution: Solution) -> None:
        self.block, self.image_points, self.solution = block, image_points, solution
        self.interior = np.full(len(block.images), -1)
        self.interior[image_points.interior.image] = np.arange(len(image_points.interior))
        self.c_mm = solution.cameras.principal_distance_mm[block.images.camera]
        self._stations = stations_of(block, image_points, solution)[0]
        self._film = self._film_corrections()
        self._errors = [self._image_error(k) for k in range(len(block.cameras))]
        self._lenses = [self._lens(k) for k in range(len(block.cameras))]

    def reduced_mm(self, image: Int, xy: Float) -> Float:
        """Photo coordinates from the principal point, corrected as the run has corrected them."""
        block, camera = self.block, self.block.images.camera[image]
        mm = measured_to_photo(self.image_points.interior, self.interior[image], xy)
        mm = mm - block.cameras.principal_point_mm[camera]
        for name in self.image_points.corrections.name.tolist() if len(image) else ():
            if name == "distortion":
                mm = mm + lens_correction(block, image, mm)[0]
            elif name in ("refraction", "earth_curvature"):
                none = np.zeros_like(mm)
                mm = mm + earth_correction(name, block, self._stations, image, mm, none, "coefficients")[0]
        return np.asarray(mm)

    def misfit_mm(self, image: Int, u: Float, mm: Float) -> Float:
        """Computed minus observed for points in image axes."""
        camera, model = self.block.images.camera[image], self.image_points.interior.model[self.interior[image]]
        photo, mm = mm + self.block.cameras.principal_point_mm[camera], mm.copy()
        for one in np.unique(model[self._film[image].any(axis=1)]):
            of_model = model == one
            K = open_basis(str(one), photo[of_model], np.eye(2))
            mm[of_model] += np.einsum("nij,nj->ni", K, self._film[image[of_model]])
        v = np.full_like(mm, np.nan)
        for k in np.unique(camera).tolist():
            of_model, lens, errors = camera == k, self._lenses[k], self._errors[k]
            if errors:
                mm[of_model] -= np.column_stack([error_mm.ev(*mm[of_model].T) for error_mm in errors])
            parameters = np.broadcast_to(lens[1], (int(of_model.sum()), len(lens[1])))
            v[of_model] = calibration.residual(lens[0], u[of_model], mm[of_model], parameters)[0]
        return v

    def ideal_mm(self, image: Int, mm: Float) -> Float:
        """Where a central projection with c would have the rays, from the adjusted principal point."""
        p, c = mm.copy(), self.c_mm[image]
        for _ in range(STEPS if len(image) else 0):
            v = self.misfit_mm(image, np.column_stack([p, -c]), mm)
            p = p - v
            if np.nanmax(np.abs(v), initial=0.0) < SETTLED_MM:
                break
        return np.asarray(p)

    def table_from_mm(self, image: int) -> Float:
        """(2, 2). Linear part of the way from photo coordinates to those of the tables."""
        return np.asarray(np.linalg.inv(self.matrix_of(image)[:, :2]))

    def matrix_of(self, image: Int | int) -> Float:
        """[A | t] of images: photo coordinates from those of the tables, without the terms of the second order."""
        return np.asarray(self.image_points.interior.matrix[self.interior[image]])

    def _film_corrections(self) -> Float:
        """d0 ... d7 of every image."""
        p, made = self.solution.parameters, np.zeros((len(self.block.images), MOST_PARAMETERS))
        row = {str(name): k for k, name in enumerate(self.block.images.id)}
        for k in np.flatnonzero(p.group == FILM).tolist():
            made[row[str(p.object[k])], int(p.name[k][-1])] = p.value[k]
        return made

    def _lens(self, camera: int) -> tuple[str, Float]:
        """Model and parameters that the adjustment has for a camera, the principal point from the nominal one.

        What additional parameters have moved is in the image error; the camera is the nominal one then.
        """
        p, name = self.solution.parameters, self.block.cameras.id[camera]
        source = self.block if self._errors[camera] else self.solution
        nominal = self.block.cameras.principal_point_mm[camera]
        moved = source.cameras.principal_point_mm[camera] - nominal
        values = {"principal_distance": float(source.cameras.principal_distance_mm[camera])}
        values |= {"q": 1.0, "principal_point.x": float(moved[0]), "principal_point.y": float(moved[1])}
        rows = (p.group == CAMERA) & (p.object == name)
        adjusted = dict(zip(p.name[rows].tolist(), p.value[rows].tolist()))
        for axis, x in zip(("principal_point.x", "principal_point.y"), nominal.tolist()):
            if axis in adjusted:
                adjusted[axis] -= x
        values |= adjusted
        model = next(m for m, names in calibration.PARAMETERS.items() if set(adjusted) <= set(names))
        return model, np.array([values.get(n, 0.0) for n in calibration.PARAMETERS[model]])

    def _image_error(self, camera: int) -> list[RectBivariateSpline]:
        """What a self-calibration found by additional parameters, in x and y, mm; nothing where there are none."""
        fields = self.solution.error_fields
        if fields is None or not (fields.object == self.block.cameras.id[camera]).any():
            return []
        rows = np.flatnonzero(fields.object == self.block.cameras.id[camera])
        rows = rows[np.lexsort(fields.xy_mm[rows].T[::-1])]
        x, y = (np.unique(fields.xy_mm[rows, axis]) for axis in (0, 1))
        return [RectBivariateSpline(x, y, 1e-3 * fields.error_um[rows, k].reshape(len(x), len(y))) for k in (0, 1)]
