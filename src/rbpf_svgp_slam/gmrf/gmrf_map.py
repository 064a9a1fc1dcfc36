"""One map of the engine gmrf."""

from __future__ import annotations

import struct
import zlib
from typing import Callable

import numpy as np

from rbpf_svgp_slam import _gmrf
from rbpf_svgp_slam.maps.stream_map import StreamMap

# Before the library's bytes, which have a checksum of their own: beams and blocks taken in,
# evidence, model, whether there are bytes of the library; the checksum of these; little-endian.
HEADER = struct.Struct("<4sQQd4d?")
CHECKSUM = struct.Struct("<I")
MAGIC = b"GMR1"


class GmrfMap(StreamMap):
    """A field on a grid, and sums over all beams; nothing in it is trained.

    The field's model is that of the node, and may change at any time; a map alone keeps the one it
    was written with.
    """

    support_label = "middles of tiles"
    skipped_steps = 0

    def __init__(
        self, field: Callable[[], _gmrf.FieldModel | None], evidence: Callable[[], float]
    ) -> None:
        """field: the model at present, none while there is none; evidence: log p per beam."""
        self._field = field
        self._evidence = evidence
        self.core: _gmrf.Map | None = None  # none before the first beam
        self.iterations = 0
        self._next_beam = 0

    @property
    def field(self) -> _gmrf.FieldModel:
        """The model at present."""
        field = self._field()
        if field is None:
            raise ValueError("the map has no model yet; expected the first beams to be studied")
        return field

    @property
    def ready(self) -> bool:
        return self._next_beam > 0

    @property
    def objective(self) -> float:
        return self._evidence()

    @property
    def noise_variance_m2(self) -> float:
        return self.field.model.noise_variance_m2 if self._field() else float("nan")

    @property
    def prior_variance_m2(self) -> float:
        return self.field.model.outputscale_m2 if self._field() else float("nan")

    @property
    def next_beam(self) -> int:
        return self._next_beam

    def take_in(self, beams: np.ndarray) -> None:
        beams = np.asarray(beams, dtype=float)
        core = self.begin(beams[:, 2])
        core.fold(beams, core.robust_weights(self.field, beams))
        self.count(len(beams))

    def begin(self, z_m: np.ndarray) -> _gmrf.Map:
        """The library's map, made for beams at these heights [n] if they are the first."""
        if self.core is None:
            self.core = _gmrf.Map(self.field.model.spacing_m, float(np.median(z_m)))
        return self.core

    def count(self, beams: int) -> None:
        """A block has been taken in."""
        self._next_beam += beams
        self.iterations += 1

    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        xy = np.asarray(xy, dtype=float)
        if self.core is None:
            return np.full(len(xy), np.nan), np.full(len(xy), self.prior_variance_m2)
        return self.core.predict(xy, self.field)

    def support_points(self) -> np.ndarray:
        if self.core is None:
            return np.empty((0, 3))
        middles = self.core.tile_middles()
        return np.column_stack([middles, self.predict(middles)[0]])

    def copy(self) -> GmrfMap:
        twin = GmrfMap(self._field, self._evidence)
        twin.core = self.core and self.core.share()
        twin.iterations, twin._next_beam = self.iterations, self._next_beam
        return twin

    def to_bytes(self) -> bytes:
        return self.pieces(_gmrf.KnownTiles(), _gmrf.TilePool())

    def pieces(self, known: _gmrf.KnownTiles, pool: _gmrf.TilePool) -> bytes:
        """As `to_bytes`, without the tiles that are known; see src/gmrf/map_bytes.hpp."""
        field = self._field()
        model = field.model if field else _gmrf.Model(1.0, 1.0, 1.0, 1.0)
        head = HEADER.pack(
            MAGIC,
            self._next_beam,
            self.iterations,
            self.objective,
            model.spacing_m,
            model.lengthscale_m,
            model.outputscale_m2,
            model.noise_variance_m2,
            self.core is not None,
        )
        head += CHECKSUM.pack(zlib.crc32(head))
        return head + (_gmrf.to_bytes(self.core, known, pool) if self.core else b"")

    @classmethod
    def from_bytes(
        cls,
        data: bytes,
        pool: _gmrf.TilePool,
        field: Callable[[], _gmrf.FieldModel | None] | None = None,
        evidence: Callable[[], float] | None = None,
    ) -> GmrfMap:
        """The map that wrote the bytes; without a field, under the model that it had.

        Raises ValueError if the bytes are damaged, of another engine, or of another spacing.
        """
        size = HEADER.size + CHECKSUM.size
        if len(data) < size or data[: len(MAGIC)] != MAGIC:
            raise ValueError(
                f"{len(data)} bytes that begin with {bytes(data[:4])!r} are no map of the engine "
                f"gmrf; expected at least {size} bytes that begin with {MAGIC!r}"
            )
        if CHECKSUM.unpack_from(data, HEADER.size)[0] != zlib.crc32(data[: HEADER.size]):
            raise ValueError(
                f"bytes of a map are damaged: the first {HEADER.size} do not have the checksum "
                "that was written"
            )
        _, next_beam, iterations, written_evidence, *model, has_core = HEADER.unpack_from(data)
        core = _gmrf.from_bytes(bytes(data[size:]), pool) if has_core else None
        if field is None:
            own = _gmrf.FieldModel(_gmrf.Model(*model))
            restored = cls(lambda: own, lambda: written_evidence)
        else:
            restored = cls(field, evidence)
            if core and core.spacing_m != restored.field.model.spacing_m:
                raise ValueError(
                    f"map was written with nodes {core.spacing_m:g} m apart; expected "
                    f"{restored.field.model.spacing_m:g} m, as this node's maps have"
                )
        restored.core = core
        restored._next_beam, restored.iterations = next_beam, iterations
        return restored
