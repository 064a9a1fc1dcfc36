"""Maps of the engine gmrf, through the contracts by which a node uses them."""

import math

import numpy as np
import pytest
from number_maps import TIMEOUT_S, in_threads, map_bytes, no_fetch, prepare_all

from rbpf_svgp_slam import _gmrf
from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_group import GmrfGroup
from rbpf_svgp_slam.gmrf.study import Study
from rbpf_svgp_slam.map_node.map_store import MapStore, SentMap
from rbpf_svgp_slam.maps import group_class, load_map
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.parameters.rules import ParameterError

NOISE_M = 0.1
KNOWN = GmrfConfig(spacing_m=1.5, lengthscale_m=12.0, outputscale_m2=0.5, noise_std_m=NOISE_M)
# Sums are kept in single precision, as are the positions that maps are asked about: micrometres,
# times the seabed's slope and what the sums make of it.
ROUNDING = {"rtol": 1e-3, "atol": 1e-4}


def depth(x, y):
    return -40.0 + 0.5 * np.sin(x / 6.0) + 0.3 * np.cos(y / 4.0)


def survey(n, seed=0):
    """Beams [n, 3] over 60 m x 40 m, line by line as a sonar gives them."""
    rng = np.random.default_rng(seed)
    x, y = np.linspace(0.0, 60.0, n), rng.uniform(0.0, 40.0, n)
    return np.column_stack([x, y, depth(x, y) + NOISE_M * rng.standard_normal(n)])


def block_for(particles, seed=0):
    """Two hundred pings of 16 beams across the track; each particle has a track of its own."""
    rng = np.random.default_rng(seed)
    pings, beams = 200, 16
    poses = np.empty((particles, pings), POSE)
    drift = np.cumsum(rng.normal(0.0, 0.02, (2, particles, pings)), axis=2)
    yaw = 0.2 + np.cumsum(rng.normal(0.0, 0.002, (particles, pings)), axis=1)
    poses["x"], poses["y"] = np.linspace(0.0, 50.0, pings) + drift[0], 20.0 + drift[1]
    poses["cos"], poses["sin"] = np.cos(yaw), np.sin(yaw)
    levelled = np.zeros((pings * beams, 3), np.float32)
    levelled[:, 1] = rng.uniform(-10.0, 10.0, pings * beams)
    block = LogBlock(levelled, np.full(pings, beams), poses)
    x, y, _ = block.placed(0).T
    levelled[:, 2] = depth(x, y) + NOISE_M * rng.standard_normal(len(levelled))
    return block


def group_of(config=KNOWN):
    group = GmrfGroup(config)
    group.study(survey(300)[:40])  # beams near to each other are studied fast
    return group


def maps_of(group, particles=3):
    """Maps with a block taken in, each on its own track."""
    maps = [group.create() for _ in range(particles)]
    group.take_in(maps, block_for(particles))
    return maps


def points(n=40, seed=5):
    return np.random.default_rng(seed).uniform([5.0, 12.0], [45.0, 28.0], (n, 2)).astype("f4")


def assert_same_predictions(one, other, **tolerance):
    for a, b in zip(one, other):
        np.testing.assert_allclose(a, b, **(tolerance or {"rtol": 0, "atol": 0}))


# What is learned of the seabed


def test_a_study_is_due_at_fixed_numbers_of_beams():
    group = GmrfGroup(KNOWN)
    assert not group.studied
    assert [group.study_due(n) for n in (0, 3999, 4000, 5000)] == [None, None, *[(0, 4000)] * 2]
    group.study(survey(300)[:40])
    assert group.studied
    assert [group.study_due(n) for n in (4000, 15999, 16000)] == [None, None, (12000, 4000)]
    group.study(survey(300)[40:80])
    assert [group.study_due(n) for n in (63999, 64000)] == [None, (60000, 4000)]


def test_the_model_is_learned_from_the_beams():
    group = GmrfGroup(GmrfConfig())
    assert math.isnan(group.create().noise_variance_m2)
    beams = survey(4000)
    group.study(beams)
    model = group.create().field.model
    # a whole number of half octaves, and at least twice as far as beams are from each other
    assert math.log(model.spacing_m, math.sqrt(2.0)) % 1.0 == pytest.approx(0.0, abs=1e-6)
    assert 2.0 * math.sqrt(60.0 * 40.0 / 4000) <= model.spacing_m <= 0.25 * model.lengthscale_m
    # From the two waves, of 0.17 m^2, and the noise that was added; a part of that may be taken for
    # what the grid cannot represent.
    assert 0.05 < model.outputscale_m2 < 3.0
    assert 0.7 * NOISE_M < math.sqrt(group.create().field.beam_variance_m2) < 1.5 * NOISE_M
    one = group.create()
    assert one.noise_variance_m2 == model.noise_variance_m2
    assert one.prior_variance_m2 == model.outputscale_m2
    assert math.isfinite(one.objective)

    again = GmrfGroup(GmrfConfig())
    again.study(beams)
    assert repr(as_numbers(again)) == repr(as_numbers(group)), "nodes would come to different maps"


def as_numbers(group):
    model = group.create().field.model
    return [
        model.spacing_m,
        model.lengthscale_m,
        model.outputscale_m2,
        model.noise_variance_m2,
    ]


@pytest.mark.parametrize("scale, noise_m", [(0.05, 0.005), (200.0, 20.0)])
def test_a_tank_and_the_deep_sea_are_learned_too(scale, noise_m):
    # A search starts from the beams' own distances and variance: a fixed start, of metres, would
    # not find its way here.
    study = Study(GmrfConfig())
    beams = survey(4000) * scale
    beams[:, 2] += (noise_m - NOISE_M * scale) * np.random.default_rng(1).standard_normal(4000)
    study.learn(beams)
    model = study.field.model
    assert math.sqrt(model.noise_variance_m2) == pytest.approx(noise_m, rel=0.4)
    assert model.spacing_m < 15.0 * scale  # of waves of 25 and 38


def test_outliers_do_not_pass_for_noise():
    beams = survey(2000)
    beams[::20, 2] += np.random.default_rng(1).uniform(-10.0, 10.0, 100)
    group = GmrfGroup(GmrfConfig())
    group.study(beams)
    assert math.sqrt(group.create().field.beam_variance_m2) < 2.0 * NOISE_M


def test_configured_values_are_kept():
    group = group_of(KNOWN)
    group.study(survey(300)[40:80])
    assert as_numbers(group) == pytest.approx([1.5, 12.0, 0.5, NOISE_M**2], rel=1e-12)
    some = group_of(GmrfConfig(spacing_m=2.5, noise_std_m=0.3))
    spacing_m, lengthscale_m, outputscale_m2, noise_variance_m2 = as_numbers(some)
    assert (spacing_m, noise_variance_m2) == (2.5, pytest.approx(0.09))
    assert lengthscale_m != 25.0 and outputscale_m2 != 1.0, "these were to be learned"


def test_the_spacing_stays_once_it_is_chosen():
    group = GmrfGroup(GmrfConfig())
    group.study(survey(1000))
    (one,) = maps_of(group, 1)
    first = as_numbers(group)
    group.study(np.multiply(survey(1000, seed=2), [4.0, 4.0, 1.0]))
    assert as_numbers(group)[0] == first[0]
    assert as_numbers(group) != first
    assert np.isfinite(one.predict(points())).all(), "maps go on under the new model"


def test_without_a_model_no_map_takes_anything_in():
    one = GmrfGroup(KNOWN).create()
    with pytest.raises(ValueError, match="no model yet; expected the first beams to be studied"):
        one.take_in(survey(10))
    assert (one.next_beam, one.ready) == (0, False)


@pytest.mark.parametrize(
    "tree, message",
    [
        ({"spacing_m": -1.0}, "gmrf/spacing_m is -1.0"),
        ({"lengthscale_m": "wide"}, "gmrf/lengthscale_m is 'wide'"),
        ({"noise_std_m": math.nan}, "gmrf/noise_std_m is nan"),
        ({"outputscale_m2": math.inf}, "gmrf/outputscale_m2 is inf"),
        ({"spacing": 1.0}, "gmrf/spacing is unknown; expected one of spacing_m, lengthscale_m"),
    ],
)
def test_parameters_that_are_not_as_expected(tree, message):
    with pytest.raises(ParameterError, match=message):
        GmrfGroup.from_parameters(tree, np.zeros((0, 2)))


# Beams


def test_beams_are_placed_by_their_pings_poses():
    block = block_for(2)
    for row in range(2):
        pose = np.repeat(block.poses[row], block.beams_of_ping)
        x, y, z = block.levelled.astype(float).T
        expected = np.column_stack(
            [
                pose["x"] + pose["cos"].astype(float) * x - pose["sin"].astype(float) * y,
                pose["y"] + pose["sin"].astype(float) * x + pose["cos"].astype(float) * y,
                z,
            ]
        )
        placed = block.placed(row)
        assert placed.dtype == np.float32
        np.testing.assert_allclose(placed, expected, rtol=3e-7, atol=3e-6)  # float32, up to 60 m
        np.testing.assert_array_equal(block.rows([row]).placed(0), placed)
    assert np.abs(block.placed(0) - block.placed(1)).max() > 0.05


def test_a_block_goes_into_every_map_where_its_particle_has_it():
    group, block = group_of(), block_for(3)
    maps = [group.create() for _ in range(3)]
    group.take_in(maps, block)
    field = maps[0].field
    alone = group.create()
    alone.take_in(block.placed(0))
    assert_same_predictions(alone.predict(points()), maps[0].predict(points()), **ROUNDING)
    first = block.placed(0).astype(float)
    reference_m = float(np.median(first[:, 2]))
    weights = _gmrf.Map(1.5, reference_m).robust_weights(field, first)
    for row, one in enumerate(maps):
        assert (one.next_beam, one.iterations, one.ready) == (len(block), 1, True)
        core = _gmrf.Map(1.5, reference_m)
        core.fold(block.placed(row).astype(float), weights)
        assert_same_predictions(core.predict(points(), field), one.predict(points()), **ROUNDING)
    # otherwise nothing has been shown
    gap_m = np.abs(maps[0].predict(points())[0] - maps[2].predict(points())[0])
    assert gap_m.max() > 0.02


def test_maps_find_the_seabed():
    for one in maps_of(group_of(), 1):
        mean, variance = one.predict(points(200))
        error_m = mean - depth(*points(200).T)
        assert np.sqrt(np.mean(error_m**2)) < NOISE_M
        assert np.all((variance > 0.0) & (variance <= one.prior_variance_m2))
        # Tiles of 16 x 16 cells of 1.5 m, wherever beams are.
        middles = one.support_points()[:, :2]
        np.testing.assert_array_equal(middles % 24.0, 12.0)
        x, y = points(200).T
        nearest_m = np.abs(middles - np.stack([x, y], axis=1)[:, None]).max(axis=2).min(axis=1)
        assert nearest_m.max() <= 12.0


def test_a_bad_block_goes_into_no_map():
    group = group_of()
    maps = maps_of(group)
    before = [one.to_bytes() for one in maps]
    block = block_for(3, seed=1)
    block.poses["x"][2, 100] = np.nan
    with pytest.raises(ValueError, match="expected finite metres"):
        group.take_in(maps, block)
    assert [one.to_bytes() for one in maps] == before
    with pytest.raises(ValueError, match="poses; expected"):
        group.take_in(maps, block_for(2))
    assert [one.to_bytes() for one in maps] == before


def test_many_maps_predict_as_each_does():
    group = group_of()
    maps = maps_of(group)
    positions = np.stack([points(seed=seed) for seed in range(3)])
    together = group.predict(maps, positions)
    assert len(together) == 3
    for one, xy, predicted in zip(maps, positions, together):
        assert_same_predictions(predicted, one.predict(xy), rtol=1e-6)  # rounded to float32
    mean, variance = group.predict([group.create()], positions[:1])[0]
    assert np.isnan(mean).all() and np.all(variance == 0.5), "a map that has seen nothing"


def test_a_copy_goes_on_by_itself():
    group = group_of()
    (one,) = maps_of(group, 1)
    before = one.to_bytes()
    twin = one.copy()
    assert twin.to_bytes() == before
    twin.take_in(survey(300, seed=3))
    assert one.to_bytes() == before != twin.to_bytes()
    one.take_in(survey(300, seed=3))
    assert one.to_bytes() == twin.to_bytes()
    empty = group.create().copy()
    assert (empty.core, empty.ready) == (None, False)


# Bytes


def test_bytes_give_the_same_map_back():
    group = group_of()
    (one,) = maps_of(group, 1)
    data = one.to_bytes()
    for restored in (group.load(data), GmrfGroup.load_saved(data), load_map("gmrf", data)):
        assert restored.to_bytes() == data
        assert (restored.next_beam, restored.iterations) == (one.next_beam, 1)
        assert restored.objective == one.objective
        assert_same_predictions(restored.predict(points()), one.predict(points()))
    saved = group_class("gmrf").load_saved(data)
    assert saved.noise_variance_m2 == pytest.approx(NOISE_M**2)
    assert saved.prior_variance_m2 == 0.5
    assert saved.field.model.lengthscale_m == 12.0
    assert saved.field.model.spacing_m == 1.5


def test_bytes_of_a_map_that_has_seen_nothing():
    for group in (GmrfGroup(KNOWN), group_of()):
        data = group.create().to_bytes()
        for restored in (group.load(data), GmrfGroup.load_saved(data)):
            assert (restored.next_beam, restored.ready) == (0, False)


def test_a_map_of_another_spacing_is_refused():
    data = maps_of(group_of(), 1)[0].to_bytes()
    other = group_of(GmrfConfig(spacing_m=2.0))
    with pytest.raises(ValueError, match="nodes 1.5 m apart; expected 2 m"):
        other.load(data)


def test_damaged_bytes_are_refused():
    group = group_of()
    data = maps_of(group, 1)[0].to_bytes()
    for size in (*range(0, 100, 7), 200, len(data) // 2, len(data) - 1):
        with pytest.raises(ValueError):
            group.load(data[:size])
    for at in (*range(100), *range(100, len(data), 997)):
        damaged = bytearray(data)
        damaged[at] ^= 1 << at % 8
        with pytest.raises(ValueError):
            GmrfGroup.load_saved(bytes(damaged))
    with pytest.raises(ValueError, match="no map of the engine gmrf"):
        group.load(b"PK\x03\x04" + data[4:])


def test_only_what_another_node_lacks_travels():
    sender, receiver = group_of(), group_of()
    maps = maps_of(sender)
    whole = [one.to_bytes() for one in maps]
    sent = sender.serialise([*maps, maps[0].copy()], receiver.known_pieces())
    assert len(sent[3]) < 0.05 * len(whole[0]), "one of the maps before it was the same"
    received = [receiver.load(data) for data in sent]
    assert [one.to_bytes() for one in received] == [*whole, whole[0]]

    again = sender.serialise(maps, receiver.known_pieces())
    assert sum(map(len, again)) < 0.05 * sum(map(len, whole))
    assert [receiver.load(data).to_bytes() for data in again] == whole

    maps[0].take_in(np.array([[20.0, 20.0, -40.0]]))
    (change,) = sender.serialise(maps[:1], receiver.known_pieces())
    assert len(change) < 0.5 * len(whole[0])
    assert receiver.load(change).to_bytes() == maps[0].to_bytes()

    with pytest.raises(ValueError, match="lack tile"):
        group_of().load(again[0])


# Resampling


def exchanging(stores, sizes):
    """What the services do between nodes, each telling what it has already."""

    def fetch_for(index):
        def fetch(epoch, wanted):
            known = stores[index].known_pieces()
            fetched = {}
            for owner, particles in wanted.items():
                maps, pasts = stores[owner].hand_over(epoch, particles, TIMEOUT_S, known)
                fetched.update(zip(particles, map(SentMap, maps, pasts)))
            sizes.append(sum(len(one.data) for one in fetched.values()))
            return fetched

        return fetch

    return [fetch_for(index) for index in range(len(stores))]


def stores_of_two_nodes():
    stores = [MapStore(node, 5, 2, group_of()) for node in range(2)]
    block = block_for(5)
    for store in stores:
        assert store.take_in(store.own, 0, 0, block.rows(store.own))
    return stores


def test_resampling_gives_every_particle_its_ancestors_map():
    stores, ancestors = stores_of_two_nodes(), [4, 1, 1, 0, 4]
    before = map_bytes(stores)
    assert len(set(before.values())) == 5
    prepare_all(stores, 1, ancestors)
    assert map_bytes(stores) == before, "the old maps stay until the commit"
    for store in stores:
        store.commit(1)
    assert map_bytes(stores) == {j: before[a] for j, a in enumerate(ancestors)}
    more = block_for(5, seed=1)
    for store in stores:
        assert store.take_in(store.own, 1, 3200, more.rows(store.own))
    maps = map_bytes(stores)
    assert len(set(maps.values())) == 5, "copies go on, each by its own particle"


def test_resampled_maps_are_not_sent_twice():
    stores, sizes = stores_of_two_nodes(), []
    whole = max(map(len, map_bytes(stores).values()))
    fetches = exchanging(stores, sizes)
    for epoch, ancestors in ((1, [0, 4, 4, 0, 0]), (2, [3, 3, 3, 3, 4])):
        before = map_bytes(stores)
        in_threads(
            *(
                lambda s=s, f=f: s.prepare(epoch, ancestors, f, TIMEOUT_S)
                for s, f in zip(stores, fetches)
            )
        )
        for store in stores:
            store.commit(epoch)
        assert map_bytes(stores) == {j: before[a] for j, a in enumerate(ancestors)}
    assert len(sizes) == 3  # in the second round the second node needs nothing
    assert min(sizes[:2]) > 0.9 * whole
    assert sizes[2] < 0.1 * whole, "that node still has it, as map 0"
    stores[0].prepare(3, [0, 0, 0, 3, 4], no_fetch, TIMEOUT_S)
