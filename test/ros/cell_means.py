"""A third engine: a grid of cell means, as maps that take in every beam once without a teacher."""

import copy
import io

import numpy as np

from rbpf_svgp_slam.maps import MapGroup, StreamMap


class CellMeanMap(StreamMap):
    """Cells of independent depths z ~ N(c, prior), seen as z + N(0, noise); c: mean of all beams.

    Its attributes are its state.
    """

    support_label = "cells"
    noise_variance_m2 = prior_variance_m2 = objective = np.nan
    next_beam = iterations = skipped_steps = 0

    def __init__(self, survey_area, cell_m, prior_std_m, noise_std_m):
        self.low, self.cell_m = survey_area.min(0), cell_m
        shape = np.ceil(np.ptp(survey_area, axis=0) / cell_m).astype(int)
        self.count, self.sum = np.zeros((2, *shape))
        self.prior_variance_m2, self.noise_variance_m2 = prior_std_m**2, noise_std_m**2

    @property
    def ready(self):
        return bool(self.iterations)

    def take_in(self, beams):
        mean, variance = self.predict(beams[:, :2])
        total = variance + self.noise_variance_m2
        error2 = (beams[:, 2] - mean) ** 2
        self.objective = -0.5 * np.mean(error2 / total + np.log(2.0 * np.pi * total))
        cells, inside = self._cells(beams[:, :2])
        np.add.at(self.count, cells, inside)
        np.add.at(self.sum, cells, np.where(inside, beams[:, 2], 0.0))
        self.next_beam += len(beams)
        self.iterations += 1

    def predict(self, xy):
        cells, inside = self._cells(xy)
        n, total = np.where(inside, [self.count[cells], self.sum[cells]], 0.0)
        c = self.sum.sum() / max(self.count.sum(), 1.0)
        # 1/variance = 1/prior + n/noise        mean = c + variance·(Σz − n·c)/noise
        variance = 1.0 / (1.0 / self.prior_variance_m2 + n / self.noise_variance_m2)
        return c + variance * (total - n * c) / self.noise_variance_m2, variance

    def support_points(self):
        xy = self.low + self.cell_m * (np.argwhere(self.count) + 0.5)
        return np.column_stack([xy, self.predict(xy)[0]])

    def copy(self):
        return copy.deepcopy(self)

    def to_bytes(self):
        buffer = io.BytesIO()
        np.savez(buffer, **vars(self))
        return buffer.getvalue()

    def _cells(self, xy):
        """Indices of the cells of [n, 2], and which of these lie on the grid [n]."""
        index = np.floor((xy - self.low) / self.cell_m).astype(int)
        inside = ((index >= 0) & (index < self.count.shape)).all(axis=1)
        return tuple(np.where(inside[:, None], index, 0).T), inside


class CellMeans(MapGroup):
    """Maps with nothing in common but their parameters."""

    map_class = CellMeanMap

    @classmethod
    def from_parameters(cls, parameters, survey_area):
        group = cls()
        group.new = CellMeanMap(survey_area, **parameters)
        return group

    def create(self):
        return self.new.copy()

    def load(self, data):
        return self.load_saved(data)

    @classmethod
    def load_saved(cls, data):
        restored = CellMeanMap.__new__(CellMeanMap)
        with np.load(io.BytesIO(data)) as file:
            vars(restored).update((name, file[name][()]) for name in file.files)
        return restored
