"""One search on many machines: the same bits, whatever fails."""

import importlib.util
import random

import pytest

import aplanat
from aplanat import ray as cluster

PLAN = {"settings": {"seed": 5, "chains": 2}}
needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed")


def begin(lens: aplanat.Lens, **changes) -> cluster.Coordinator:
    settings = {"gradients": 360, "groups": 3, "period": 40, **changes}
    return cluster.Coordinator(lens, PLAN, **settings)


@pytest.fixture
def undisturbed(singlet):
    state = begin(singlet)
    for state in cluster.run_here(state):
        pass
    return state


def test_groups_exchange_lenses_and_find_better_ones(singlet, undisturbed):
    assert undisturbed.taken == 360 and undisturbed.is_finished
    merit, lens = undisturbed.best
    assert merit < aplanat.Search(singlet, PLAN).found[0][0]
    assert lens.data["name"] == singlet.data["name"]


def test_the_result_is_the_same_after_random_failures(singlet, undisturbed):
    state, dice = begin(singlet), random.Random(7)
    failures = 0
    while not state.is_finished:
        periods = state.periods()
        outcomes = {}
        order = list(range(len(periods)))
        dice.shuffle(order)
        while len(outcomes) < len(periods):
            i = order[dice.randrange(len(order))]
            if dice.random() < 0.3:
                failures += 1  # A machine is lost after its work, which is done again.
                cluster.work(periods[i])
            else:
                outcomes[i] = cluster.check(periods[i], cluster.work(periods[i]))
        state.accept(periods, [outcomes[i] for i in range(len(periods))])
    assert failures > 3 and state.fingerprint == undisturbed.fingerprint


def test_a_saved_search_goes_on_with_the_same_bits(singlet, undisturbed, tmp_path):
    state = begin(singlet)
    next(cluster.run_here(state))
    state.save(tmp_path / "search.json")
    again = cluster.Coordinator.load(tmp_path / "search.json")
    for again in cluster.run_here(again):
        pass
    assert again.fingerprint == undisturbed.fingerprint
    (tmp_path / "search.json").write_text("{}", encoding="utf-8")
    with pytest.raises(aplanat.InputError, match="not a search"):
        cluster.Coordinator.load(tmp_path / "search.json")


def test_what_a_machine_returns_is_not_believed(singlet, double_gauss):
    period = begin(singlet).periods()[0]
    good = cluster.work(period)
    assert cluster.check(period, good) == good
    other = cluster.work(begin(double_gauss, period=2).periods()[0])
    from dataclasses import replace

    bad = [
        None,
        b"garbage",
        other,
        replace(good, state=good.state[:-40]),
        replace(good, state=b"\xff\x00"),
        replace(good, merits=(float("nan"), *good.merits[1:])),
        replace(good, merits=(0.0, *good.merits[1:])),
        replace(good, lenses=("{}", *good.lenses[1:])),
        replace(good, version="0.0.0"),
    ]
    for outcome in bad:
        with pytest.raises(aplanat.InputError):
            cluster.check(period, outcome)
    with pytest.raises(aplanat.InputError, match=r"0\.0\.0"):
        cluster.work(replace(period, version="0.0.0"))


def test_wrong_settings_are_refused_before_any_work(singlet):
    with pytest.raises(aplanat.InputError, match="groups"):
        begin(singlet, groups=0)
    with pytest.raises(aplanat.InputError, match="chains"):
        cluster.Coordinator(singlet, {"settings": {"chains": 0}}, 100)
    with pytest.raises(aplanat.InputError, match="nothing"):
        cluster.Coordinator(singlet, {"nothing": 1}, 100)


@pytest.fixture(scope="module")
def two_workers():
    import ray

    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


@needs_ray
def test_ray_gives_the_same_bits(singlet, undisturbed, two_workers):
    for state in cluster.search(singlet, PLAN, gradients=360, groups=3, period=40):
        pass
    assert state.fingerprint == undisturbed.fingerprint


@needs_ray
def test_fronts_commands_and_fields_come_from_machines(double_gauss, two_workers):
    front = cluster.pareto(double_gauss, points=2, slices=2, steps=5)
    spots = [numbers.spot for numbers, _ in front]
    assert len(front) >= 2 and spots == sorted(spots), "brighter is less sharp"
    again = cluster.pareto(double_gauss, points=2, slices=2, steps=5)
    assert [lens for _, lens in again] == [lens for _, lens in front]
    [info] = cluster.commands([("info", "lenses/singlet_la1131.json")])
    assert info.efl > 0
    [(values, _, _)] = cluster.grin(["luneburg-radial"], nodes=9)
    assert values.shape == (9, 9, 9)
    with pytest.raises(aplanat.InputError, match="slices"):
        cluster.pareto(double_gauss, points=2, slices=3)
