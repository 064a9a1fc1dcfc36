"""The maps of one node of the engine gmrf."""

from __future__ import annotations

from typing import Any, Mapping, Sequence

import numpy as np

from rbpf_svgp_slam import _gmrf
from rbpf_svgp_slam.gmrf.beam_weights import BeamWeights
from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_map import GmrfMap
from rbpf_svgp_slam.gmrf.study import Study
from rbpf_svgp_slam.maps.log_block import LogBlock
from rbpf_svgp_slam.maps.map_group import MapGroup


class GmrfGroup(MapGroup):
    """Maps under one model, which is learned from the log; copies share their tiles."""

    map_class = GmrfMap
    maps_at_once = 1000

    def __init__(self, config: GmrfConfig) -> None:
        self._study = Study(config)
        self._pool = _gmrf.TilePool()
        self._weights = BeamWeights()

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], survey_area: np.ndarray) -> GmrfGroup:
        return cls(GmrfConfig.from_parameters(parameters))

    def create(self) -> GmrfMap:
        return GmrfMap(self._field, self._evidence)

    def create_anew(self) -> GmrfMap:
        self._weights.begin_refolding()
        return self.create()

    def load(self, data: bytes) -> GmrfMap:
        return GmrfMap.from_bytes(data, self._pool, self._field, self._evidence)

    @classmethod
    def load_saved(cls, data: bytes) -> GmrfMap:
        return GmrfMap.from_bytes(data, _gmrf.TilePool())

    def study_due(self, beams_in_log: int) -> tuple[int, int] | None:
        return self._study.due(beams_in_log)

    def study(self, beams: np.ndarray) -> None:
        self._study.learn(beams)

    @property
    def studied(self) -> bool:
        return self._study.field is not None

    def take_in(self, maps: Sequence[GmrfMap], block: LogBlock) -> None:
        levelled = _gmrf.LevelledBlock(block.levelled, block.ping_of_beam, len(block.beams_of_ping))
        cores = [one.begin(block.levelled[:, 2]) for one in maps]
        # What lies off the seabed does so in every map: the first one tells.
        weights = self._weights.of(
            maps[0].next_beam,
            len(block),
            lambda: cores[0].robust_weights(self._study.field, block.placed(0).astype(float)),
        )
        _gmrf.fold_into_all(cores, levelled, block.poses.tobytes(), weights)
        for one in maps:
            one.count(len(block))

    def predict(
        self, maps: Sequence[GmrfMap], positions: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        if any(one.core is None for one in maps):
            return super().predict(maps, positions)
        return list(
            zip(*_gmrf.predict_each([one.core for one in maps], positions, self._study.field))
        )

    def serialise(self, maps: Sequence[GmrfMap], known: bytes) -> list[bytes]:
        hashes = _gmrf.KnownTiles(np.frombuffer(known, "<u8"))
        return [one.pieces(hashes, self._pool) for one in maps]

    def known_pieces(self) -> bytes:
        return np.array(self._pool.hashes, "<u8").tobytes()

    def _field(self) -> _gmrf.FieldModel | None:
        return self._study.field

    def _evidence(self) -> float:
        return self._study.evidence
