"""One search on many machines: the same bits, whatever fails."""

import importlib.util
import json
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent import futures
from dataclasses import replace
from pathlib import Path

import pytest

import aplanat
from aplanat import ray as cluster
from aplanat.ray import schedule, store
from aplanat.ray.actor import SearchActor

PLAN = {"settings": {"seed": 5, "chains": 2}}
needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed")


def begin(lens: aplanat.Lens, **changes) -> cluster.Coordinator:
    settings = {"gradients": 360, "groups": 3, "period": 30, **changes}
    return cluster.Coordinator(lens, PLAN, **settings)


@pytest.fixture(scope="module")
def undisturbed():
    *_, state = cluster.run_here(begin(aplanat.Lens.bundled("singlet_la1131")))
    return state


class Threads:
    """Machines that are threads, `trouble` of which may do something else than their work."""

    def __init__(self, count: int = 2, trouble=lambda period: None) -> None:
        self.count, self.trouble, self.given_up = count, trouble, []
        self.pool = futures.ThreadPoolExecutor(count)

    def _work(self, period):
        other = self.trouble(period)
        outcome = cluster.work(period) if other is None else other()
        return outcome, cluster.judge(period, outcome)

    def begin(self, period):
        return self.pool.submit(self._work, period)

    def wait(self, begun, seconds):
        return list(futures.wait(begun, seconds, futures.FIRST_COMPLETED).done)

    def outcome(self, begun):
        return cluster.confirm(*begun.result())

    def give_up(self, begun):
        self.given_up.append(begun)

    def free(self, busy):
        return self.count - busy


def test_groups_exchange_lenses_and_find_better_ones(singlet, undisturbed):
    assert undisturbed.taken == 360 and undisturbed.is_finished
    merit, lens = undisturbed.best
    assert merit < aplanat.Search(singlet, PLAN).found[0][0]
    assert lens.data["name"] == singlet.data["name"]
    assert [merit for merit, _ in undisturbed.found] == sorted(m for m, _ in undisturbed.found)


def test_a_group_waits_for_none_but_the_slowest_by_a_period(singlet):
    state = begin(singlet)
    for _ in range(2):
        state.accept(0, cluster.work(state.begin(0)))
    assert state.ready() == [1, 2], "the first one is a period ahead"
    state.accept(1, cluster.work(state.begin(1)))
    assert state.ready() == [1, 2]
    state.accept(2, cluster.work(state.begin(2)))
    assert state.ready() == [0, 1, 2]
    assert len(state.begin(0).received) == 2 and state.begin(1).received == ()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_result_does_not_depend_on_the_order(singlet, undisturbed, seed):
    state, dice = begin(singlet), random.Random(seed)
    while not state.is_finished:
        i = dice.choice(state.ready())
        period = state.begin(i)
        if dice.random() < 0.3:
            cluster.work(period)  # A machine is lost after its work, which is done again.
        state.accept(i, cluster.check(period, cluster.work(period)))
    assert state.fingerprint == undisturbed.fingerprint


@pytest.mark.parametrize("machines", [1, 2, 8])
def test_what_fails_is_done_again(singlet, undisturbed, machines):
    dice, begun = random.Random(machines), Counter()

    def fail():
        raise RuntimeError("lost")

    def trouble(period):
        begun[period.plan] += 1
        nothing, garbage = (lambda: None), (lambda: b"garbage")
        last = begun[period.plan] == schedule.ATTEMPTS
        return None if last else dice.choice([None, fail, nothing, garbage])

    run = cluster.Schedule(begin(singlet), Threads(machines, trouble))
    while not run.search.is_finished:
        run.step()
    assert run.search.fingerprint == undisturbed.fingerprint
    assert any("done again" in message for message in run.messages)


def test_a_period_that_always_fails_ends_the_search(singlet):
    run = cluster.Schedule(begin(singlet), Threads(1, lambda period: lambda: None))
    with pytest.raises(cluster.LostPeriodError, match="failed 5 times: a machine returned NoneType"):
        while True:
            run.step()


def test_a_slow_period_is_done_a_second_time_elsewhere(singlet, undisturbed, monkeypatch):
    monkeypatch.setattr(schedule, "LEAST", 0.2)
    stuck, waits = threading.Event(), iter([True])
    machines = Threads(3)
    third = iter(range(100))

    def trouble(period):
        # The fourth period never ends: its machine is stuck.
        return (lambda: stuck.wait(30)) if next(third) == 3 and next(waits, False) else None

    machines.trouble = trouble
    run, began = cluster.Schedule(begin(singlet), machines), time.monotonic()
    while not run.search.is_finished:
        run.step(0.1)
    assert time.monotonic() - began < 25 and len(machines.given_up) == 1
    assert any("is slow" in message for message in run.messages)
    assert run.search.fingerprint == undisturbed.fingerprint
    stuck.set()


def test_a_saved_search_goes_on_with_the_same_bits(singlet, undisturbed, tmp_path):
    path = tmp_path / "search"
    state = begin(singlet)
    store.save(state, path)
    dice = random.Random(3)
    while not state.is_finished:
        i = dice.choice(state.ready())
        state.accept(i, cluster.work(state.begin(i)))
        if dice.random() < 0.5:
            store.save(state, path)
        if dice.random() < 0.3:
            state = store.load(path)
    assert state.fingerprint == undisturbed.fingerprint


def test_files_that_are_no_search_or_another_one_are_refused(singlet, tmp_path):
    path = tmp_path / "search"
    for content in (b"{}", b"garbage" * 1000, b"SQLite format 3\x00" + bytes(5000)):
        path.write_bytes(content)
        with pytest.raises(aplanat.InputError, match="not a search"):
            store.load(path)
    path.write_bytes(b"")
    assert store.resume(begin(singlet), path).accepted == 0, "a file that was never written"
    path.unlink()
    store.save(begin(singlet), path)
    with pytest.raises(aplanat.InputError, match="`period`"):
        store.resume(begin(singlet, period=31), path)
    with pytest.raises(aplanat.InputError, match="`groups`"):
        next(cluster.search(singlet, PLAN, gradients=360, groups=2, period=30, checkpoint=path))


class Here(Threads):
    """A machine that does its work at once, in this thread."""

    def begin(self, period):
        done = futures.Future()
        done.set_result(self._work(period))
        return done


def test_a_full_disk_does_not_end_the_search(singlet, undisturbed, tmp_path):
    class Full(SearchActor):
        def _save(self):
            usual = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, usual[1]))
            try:
                super()._save()
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, usual)

    actor = Full(begin(singlet), str(tmp_path / "search"), str(tmp_path / "watch"), Here)
    progress = actor.run()
    assert progress.fingerprint == undisturbed.fingerprint
    assert len([text for text in progress.messages if "is not saved" in text]) == 1
    SearchActor._save(actor)
    assert store.load(tmp_path / "search").fingerprint == undisturbed.fingerprint
    assert (tmp_path / "watch").read_bytes() == undisturbed.best_state


def test_what_a_machine_returns_is_not_believed(singlet, double_gauss):
    period = begin(singlet).begin(0)
    good = cluster.work(period)
    assert cluster.check(period, good) == good
    other = cluster.work(begin(double_gauss, period=2).begin(0))
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
    verdict = cluster.judge(period, good)
    another = cluster.work(begin(singlet).begin(1))
    for wrong in (None, replace(verdict, digest=b""), replace(verdict, merits=verdict.merits[1:])):
        with pytest.raises(aplanat.InputError, match="a machine"):
            cluster.confirm(good, wrong)
    with pytest.raises(aplanat.InputError, match="something else"):
        cluster.confirm(another, verdict)


def test_wrong_settings_are_refused_before_any_work(singlet):
    with pytest.raises(aplanat.InputError, match="groups"):
        begin(singlet, groups=0)
    with pytest.raises(aplanat.InputError, match="chains"):
        cluster.Coordinator(singlet, {"settings": {"chains": 0}}, 100)
    with pytest.raises(aplanat.InputError, match="nothing"):
        cluster.Coordinator(singlet, {"nothing": 1}, 100)


def test_slices_of_a_front_are_neighbours_in_its_levels():
    from aplanat.ray.tasks import _slices

    parts = _slices(5, 2, {"light": (0.5, 8.0), "steps": 3})
    assert [part["points"] for part in parts] == [2, 3] and all(part["steps"] == 3 for part in parts)
    assert parts[0]["light"] == pytest.approx([0.5, 1.0])
    assert parts[1]["light"] == pytest.approx([2.0, 8.0])
    [whole] = _slices(3, 1, {"scalarization": "weighted_sum"})
    assert whole["blur"] == pytest.approx([4e-5, 3.5e-3]) and "light" not in whole


@pytest.fixture(scope="module")
def two_workers():
    # Ray's workers would yield to every other process of the machine.
    os.environ.setdefault("RAY_worker_niceness", "0")
    ray = cluster.connect(2)
    yield
    ray.shutdown()


@needs_ray
def test_ray_gives_the_same_bits(singlet, undisturbed, two_workers, tmp_path):
    files = {"checkpoint": tmp_path / "search", "watch": tmp_path / "watch.json"}
    settings = {"gradients": 360, "groups": 3, "period": 30, **files}
    *_, progress = cluster.search(singlet, PLAN, **settings)
    assert progress.fingerprint == undisturbed.fingerprint
    assert progress.best[1] == undisturbed.best[1] and progress.gradients == 360
    # A finished search goes on to its end, and the studio opens its best group.
    *_, again = cluster.search(singlet, PLAN, **settings)
    assert again.fingerprint == undisturbed.fingerprint
    assert (tmp_path / "watch.json").read_bytes() == undisturbed.best_state


@needs_ray
def test_killed_actors_and_workers_change_no_bit(singlet, two_workers, tmp_path):
    sys.path.insert(0, str(Path(__file__).parents[2] / "assets" / "cluster"))
    from kill_workers import ACTOR, WORKER, own_processes

    settings = {"gradients": 12_000, "groups": 2, "period": 250}
    *_, expected = cluster.run_here(cluster.Coordinator(singlet, PLAN, **settings))
    actors = set()
    for progress in cluster.search(singlet, PLAN, checkpoint=tmp_path / "search", **settings):
        if progress.process not in actors and len(actors) < 2:
            for process in (progress.process, *own_processes(WORKER)[:1]):
                os.kill(process, signal.SIGKILL)
        actors.add(progress.process)
    assert len(actors) >= 2 and progress.fingerprint == expected.fingerprint
    assert ACTOR.startswith("ray::")


@needs_ray
def test_a_search_is_stopped_by_breaking_off_the_loop(singlet, two_workers):
    import ray

    for progress in cluster.search(singlet, PLAN, gradients=10**9, groups=2, period=50):
        if progress.periods > 3:
            break
    used = lambda: ray.cluster_resources()["CPU"] - ray.available_resources().get("CPU", 0)
    begin = time.monotonic()
    while used() and time.monotonic() - begin < 30:
        time.sleep(0.1)
    assert used() == 0, "the workers are free again"


@needs_ray
def test_fronts_commands_and_fields_come_from_machines(double_gauss, two_workers):
    front = cluster.pareto(double_gauss, points=2, slices=2, steps=5)
    spots, lights = ([getattr(n, name) for n, _ in front] for name in ("spot", "light"))
    assert len(front) >= 2 and spots == sorted(spots), "brighter is less sharp"
    assert len(set(lights)) == len(lights) and lights == sorted(lights)
    again = cluster.pareto(double_gauss, points=2, slices=2, steps=5)
    assert [lens for _, lens in again] == [lens for _, lens in front]
    [info] = cluster.commands([("info", "lenses/singlet_la1131.json")])
    assert info.efl > 0
    runs = cluster.studies(("tolerance", double_gauss, "--samples", 20), [1, 2, 1])
    assert runs[0].seed == 1 and runs[1].seed == 2
    [(values, _, _)] = cluster.grin(["luneburg-radial"], nodes=9)
    assert values.shape == (9, 9, 9)
    with pytest.raises(aplanat.InputError, match="slices"):
        cluster.pareto(double_gauss, points=2, slices=3)
    with pytest.raises(aplanat.InputError, match="missing"):
        cluster.commands([("info", "missing.json")])
    with pytest.raises(aplanat.InputError, match="the task"):
        cluster.grin(["nothing"])


@needs_ray
def test_the_command_line_searches_and_refuses(singlet, tmp_path):
    path, out = tmp_path / "lens.json", tmp_path / "best.json"
    singlet.save(path)

    def command(*words):
        words = [sys.executable, "-m", "aplanat.ray", *map(str, words)]
        return subprocess.run(words, capture_output=True, text=True, timeout=120)

    search = ("search", path, "--out", out, "--gradients", 60, "--period", 30)
    done = command(*search)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["gradients"] == 60 and aplanat.Lens.open(out) is not None
    wrong = command(*search, "--groups", 0)
    assert wrong.returncode == 2 and "groups: found 0" in wrong.stderr
