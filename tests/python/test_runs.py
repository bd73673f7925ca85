"""Merit functions and runs that are watched and stopped."""

import signal
import threading
import time

import numpy as np
import pytest

import aplanat

SPOT = {"terms": [{"term": "spot", "weight": 1.0}]}
CURVATURES = [f"curvature[{i}]" for i in range(4)]


def test_merits_have_the_derivatives_of_differences(double_gauss):
    names = [*CURVATURES, "thickness[1]", "semi_diameter[0]"]
    merit = aplanat.Merit(double_gauss, SPOT, names, tolerance=1e-8)
    values = merit.values(double_gauss)
    assert values.tolist() == [double_gauss[name] for name in names]
    value, gradient = merit.gradient(values)
    assert value == pytest.approx(merit.value(values), rel=1e-12)
    for i, slope in enumerate(gradient):
        step = np.zeros(len(names))
        step[i] = 1e-6
        difference = (merit.value(values + step) - merit.value(values - step)) / 2e-6
        assert slope == pytest.approx(difference, rel=1e-4, abs=1e-7 * np.abs(gradient).max())
    assert merit.terms(values)[0].term == "spot"
    with pytest.raises(aplanat.InputError, match="expected 6"):
        merit.value([1.0])


def test_goals_that_are_wrong_are_refused(double_gauss):
    with pytest.raises(aplanat.InputError, match="goal"):
        aplanat.Merit(double_gauss, {"terms": [{"term": "nothing", "weight": 1}]}, CURVATURES)
    with pytest.raises(aplanat.InputError, match="no variables"):
        aplanat.Optimizer(double_gauss, SPOT, [])
    with pytest.raises(aplanat.InputError, match="tolerance"):
        aplanat.Merit(double_gauss, SPOT, CURVATURES, tolerance=0.0)


def test_an_optimizer_is_watched_and_stopped(double_gauss):
    optimizer = aplanat.Optimizer(double_gauss, names=CURVATURES, tolerance=1e-4)
    merits = []
    for progress in optimizer:
        merits.append(progress.best)
        if progress.step == 5:
            break
    assert len(merits) == 5 and merits[-1] < merits[0]
    report = optimizer.verify()
    assert {term.term for term in report.terms} >= {"spot"}
    assert optimizer.best != double_gauss
    efl = aplanat.info(optimizer.best).efl
    assert efl == pytest.approx(aplanat.info(double_gauss).efl, rel=1e-3)
    with pytest.raises(aplanat.InputError, match="method"):
        aplanat.Optimizer(double_gauss, names=CURVATURES, method="magic")


def test_a_front_grows(double_gauss):
    sweep = aplanat.pareto(double_gauss, points=2, steps=5)
    steps = list(sweep)
    assert steps[-1].finished and steps[-1].done == steps[-1].total
    numbers, lens = sweep.front[-1]
    assert numbers.spot > 0 and numbers.light > 0 and lens.surface_count > 0
    with pytest.raises(aplanat.InputError, match="settings"):
        aplanat.pareto(double_gauss, nothing=1)


def test_a_search_goes_on_from_its_checkpoint(singlet, tmp_path):
    plan = {"settings": {"gradients": 200, "seed": 3}}
    whole = aplanat.Search(singlet, plan)
    *_, last = whole
    assert last.ended and last.statistics.gradients <= 200
    half = aplanat.Search(singlet, plan)
    for _, _round in zip(range(5), half, strict=False):
        pass
    half.save(tmp_path / "half.json")
    rest = aplanat.Search(singlet, plan, checkpoint=tmp_path / "half.json")
    *_, end = rest
    assert end.best == last.best and rest.best == whole.best
    assert rest.found[0][0] <= rest.found[-1][0]


def test_a_grin_task_gives_its_field():
    task = aplanat.GrinTask("luneburg")
    first, second = next(task), next(task)
    assert second.step == first.step + 1
    values, low, spacing = task.field(17)
    assert values.ndim == 3 and (values >= 0.9).all() and np.isfinite(values).all()
    assert low.shape == spacing.shape == (3,) and (spacing > 0).all()
    with pytest.raises(aplanat.InputError):
        aplanat.GrinTask("nothing")


def test_the_variables_of_a_lens_stay_its_own(double_gauss):
    variables = double_gauss.data["variables"]
    merit = aplanat.Merit(double_gauss, SPOT, CURVATURES)
    assert merit.lens(merit.values(double_gauss)) == double_gauss
    assert aplanat.Optimizer(double_gauss, SPOT, CURVATURES).best.data["variables"] == variables
    with pytest.raises(aplanat.InputError, match="twice"):
        aplanat.Merit(double_gauss, SPOT, [CURVATURES[0], CURVATURES[0]])


def test_commands_that_list_return_lists(double_gauss):
    assert "luneburg" in {task.name for task in aplanat.run("grin")}
    assert all(lens.name for lens in aplanat.run("library", "tessar"))
    points = aplanat.analyze(double_gauss, "psf", at=[(0, 0), (0, 0.01)], error=1e-2).fields[0].points
    assert [point.y for point in points] == [0.0, 0.01]
    mtf = aplanat.analyze(double_gauss, "mtf", frequencies=np.array([10.0, 20.0]), error=1e-2)
    assert [point.frequency for point in mtf.fields[0].geometric.points] == [10.0, 20.0]
    modulus = mtf.fields[0].geometric.points[0].tangential.modulus
    assert f"{modulus:.2f}".startswith("0.") and modulus.rays > 0 and modulus.seconds > 0.0


def test_control_c_ends_a_long_command(double_gauss, tmp_path):
    stop = threading.Timer(1.0, signal.raise_signal, [signal.SIGINT])
    stop.start()
    begin = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        out = tmp_path / "best.json"
        aplanat.run("search", double_gauss, "--iterations", "1000000", "--out", out)
    assert time.perf_counter() - begin < 20.0
