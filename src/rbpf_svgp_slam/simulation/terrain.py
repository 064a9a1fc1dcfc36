"""Seabed grids: files, bilinear lookup, and a generator of fractal relief with dunes."""

import dataclasses

import numpy as np

from rbpf_svgp_slam.npz import READING_ERRORS
from rbpf_svgp_slam.simulation import SurveyError


@dataclasses.dataclass(frozen=True)
class Terrain:
    """Heights on a regular grid in the map frame.

    z_m: [nx, ny] float32, z up (the seabed is negative), axis 0 along x, axis 1 along y.
    resolution_m: distance between neighbouring nodes.
    origin_m: [2], x and y of z_m[0, 0].
    """

    z_m: np.ndarray
    resolution_m: float
    origin_m: np.ndarray

    @property
    def upper_m(self):
        """x and y [2] of the last node."""
        return self.origin_m + self.resolution_m * (np.array(self.z_m.shape) - 1)

    def contains(self, x_m, y_m):
        """Whether points of any one shape lie on the grid."""
        (x_lo, y_lo), (x_hi, y_hi) = self.origin_m, self.upper_m
        return (x_m >= x_lo) & (x_m <= x_hi) & (y_m >= y_lo) & (y_m <= y_hi)

    def height_m(self, x_m, y_m):
        """Bilinear height at points of any one shape; NaN off the grid and next to NaN nodes."""
        nx, ny = self.z_m.shape
        u = (x_m - self.origin_m[0]) / self.resolution_m
        v = (y_m - self.origin_m[1]) / self.resolution_m
        i = np.clip(u.astype(np.intp), 0, nx - 2)
        j = np.clip(v.astype(np.intp), 0, ny - 2)
        a, b = u - i, v - j
        flat, k = self.z_m.ravel(), i * ny + j
        near = flat.take(k) * (1 - b) + flat.take(k + 1) * b
        far = flat.take(k + ny) * (1 - b) + flat.take(k + ny + 1) * b
        height_m = near * (1 - a) + far * a
        height_m[(u < 0) | (u > nx - 1) | (v < 0) | (v > ny - 1)] = np.nan
        return height_m


def load_terrain(path, centre_m):
    """Read a terrain npz: `z` [nx, ny], `resolution_m` and, optionally, `origin_m` [2].

    Without `origin_m` the middle of the grid is placed at centre_m [2] in the map frame.
    """
    arrays = _read_npz(path)
    for key, meaning in (("z", "[nx, ny] heights in m"), ("resolution_m", "the node spacing in m")):
        if key not in arrays:
            raise SurveyError(f"terrain {path}: array '{key}' is missing, expected {meaning}")
    z, resolution = arrays["z"], arrays["resolution_m"]
    if z.ndim != 2 or min(z.shape) < 2 or z.dtype.kind not in "fiu":
        raise SurveyError(
            f"terrain {path}: z is {z.dtype} {z.shape}, expected numbers [nx, ny] of at least 2 x 2"
        )
    if not np.isfinite(z).any():
        raise SurveyError(f"terrain {path}: z has no finite value")
    if resolution.size != 1 or resolution.dtype.kind not in "fiu" or not 0 < resolution < np.inf:
        raise SurveyError(f"terrain {path}: resolution_m is {resolution}, expected one number > 0")
    resolution_m = float(resolution)
    default_m = np.asarray(centre_m) - 0.5 * resolution_m * (np.array(z.shape) - 1)
    origin = arrays.get("origin_m", default_m)
    if origin.shape != (2,) or origin.dtype.kind not in "fiu" or not np.isfinite(origin).all():
        raise SurveyError(f"terrain {path}: origin_m is {origin}, expected two finite numbers")
    z_m = np.where(np.isfinite(z), z, np.nan).astype(np.float32)
    return Terrain(z_m, resolution_m, origin.astype(float))


def _read_npz(path):
    try:
        with np.load(path, allow_pickle=False) as npz:
            return {key: npz[key] for key in npz.files}
    except FileNotFoundError:
        raise SurveyError(f"terrain {path}: no such file") from None
    except READING_ERRORS as error:
        raise SurveyError(f"terrain {path}: expected an npz file ({error})") from None


def save_terrain(path, terrain):
    """Write the terrain with its placement, so that reading it back gives the same map frame."""
    np.savez_compressed(
        path, z=terrain.z_m, resolution_m=terrain.resolution_m, origin_m=terrain.origin_m
    )


@dataclasses.dataclass(frozen=True)
class Relief:
    """What generated seabed is made of.

    By default several metres from peak to trough, mostly in features of 15 to 80 m: what a vehicle
    with a 50 m swath can tell its position by.
    """

    longest_m: float = 150.0  # wavelength of the largest features
    fractal_m: float = 1.6  # standard deviation of the fractal part
    dunes_m: float = 0.9  # about the amplitude of the dunes


def generate_terrain(lower_m, upper_m, resolution_m, mean_m, rng, relief=Relief()):
    """Fractal relief plus dunes over the box lower_m .. upper_m ([2] each), around height mean_m.

    The power of the fractal part falls steeply with frequency, as seabeds' does.
    """
    lower_m = np.asarray(lower_m, float)
    shape = np.ceil((np.asarray(upper_m) - lower_m) / resolution_m).astype(int) + 1
    wavelengths_m = (6.0, relief.longest_m)
    fractal_m = relief.fractal_m * _fractal(shape, resolution_m, wavelengths_m, 3.6, rng)
    dunes_m = relief.dunes_m * _dunes(shape, resolution_m, rng)
    z_m = mean_m + fractal_m + dunes_m
    return Terrain(z_m.astype(np.float32), float(resolution_m), lower_m)


def _fractal(shape, resolution_m, wavelengths_m, exponent, rng):
    """A unit-variance Gaussian field [nx, ny]: power falls as frequency^-exponent in the band."""
    fx = np.fft.fftfreq(shape[0], resolution_m)[:, None]
    fy = np.fft.rfftfreq(shape[1], resolution_m)[None, :]
    frequency = np.hypot(fx, fy)
    low, high = 1 / wavelengths_m[1], 1 / wavelengths_m[0]
    amplitude = np.maximum(frequency, low) ** (-exponent / 2)
    # Both ends are soft: a sharp cut would ring across the whole grid.
    amplitude *= np.exp(-((frequency / high) ** 2)) * (1 - np.exp(-((frequency / low) ** 2)))
    white = rng.standard_normal(tuple(shape))
    field = np.fft.irfft2(np.fft.rfft2(white) * amplitude, s=tuple(shape))
    return field / field.std()


def _dunes(shape, resolution_m, rng):
    """Dunes [nx, ny] of about unit height and 40 m wavelength; winding crests, steep lee sides."""
    heading_rad = rng.uniform(0, np.pi)
    x_m = resolution_m * np.arange(shape[0])[:, None]
    y_m = resolution_m * np.arange(shape[1])[None, :]
    along_m = x_m * np.cos(heading_rad) + y_m * np.sin(heading_rad)
    winding_m = 8.0 * _fractal(shape, resolution_m, (40.0, 200.0), 3.0, rng)
    phase = 2 * np.pi * (along_m + winding_m) / 40.0
    strength = 1 + 0.4 * _fractal(shape, resolution_m, (60.0, 200.0), 3.0, rng)
    return strength * (np.sin(phase) + 0.3 * np.sin(2 * phase))
