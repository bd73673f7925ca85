"""Lenses: files, numbers by name, errors."""

import json
import pickle
import threading

import pytest

import aplanat


def test_numbers_have_names(double_gauss):
    names = double_gauss.names()
    assert "curvature[0]" in names and "semi_diameter[0]" in names
    assert double_gauss.surface_count == sum(name.startswith("thickness") for name in names)
    data = double_gauss.data["surfaces"][0]
    assert double_gauss["curvature[0]"] == data["curvature"]
    before = double_gauss["curvature[0]"]
    changed = double_gauss.with_numbers({"curvature[0]": 0.02})
    assert changed["curvature[0]"] == 0.02 and double_gauss["curvature[0]"] == before
    assert changed != double_gauss and double_gauss.copy() == double_gauss


@pytest.mark.parametrize(
    "name", ["curvature", "curvature[99]", "asphere[0]", "index[0]", "nonsense[1]", "conic[-1]", ""]
)
def test_a_name_that_is_none_is_refused(double_gauss, name):
    with pytest.raises(aplanat.InputError, match=r"expected|no number"):
        double_gauss[name]


def test_a_lens_stays_as_it_is_if_a_number_is_refused(double_gauss):
    before = double_gauss.numbers()
    for value in (float("nan"), float("inf"), 1e300):
        with pytest.raises(aplanat.InputError):
            double_gauss["thickness[0]"] = value
    assert double_gauss.numbers() == before


@pytest.mark.parametrize("extension", ["json", "zmx", "seq"])
def test_files_come_back(double_gauss, tmp_path, extension):
    path = tmp_path / f"lens.{extension}"
    report = double_gauss.save(path)
    again = aplanat.Lens.open(path)
    assert report["format"] and again.surface_count == double_gauss.surface_count
    efl = [aplanat.info(lens) for lens in (double_gauss, again)]
    assert efl[0].efl == pytest.approx(efl[1].efl, rel=1e-12)


def test_a_lens_is_pickled_and_is_its_data(double_gauss):
    assert pickle.loads(pickle.dumps(double_gauss)) == double_gauss
    assert aplanat.Lens(double_gauss.data) == double_gauss
    assert json.loads(json.dumps(double_gauss.data)) == double_gauss.data


def test_wrong_files_are_refused_with_the_text_of_the_command_line(tmp_path):
    with pytest.raises(aplanat.InputError, match="missing.json"):
        aplanat.Lens.open(tmp_path / "missing.json")
    path = tmp_path / "picture.zmx"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(aplanat.InputError, match="PNG"):
        aplanat.Lens.open(path)
    with pytest.raises(aplanat.InputError, match="expected one of"):
        aplanat.Lens.bundled("nothing")
    with pytest.raises(aplanat.InputError, match="`object`"):
        aplanat.Lens({"aplanat": 1})


def test_commands_return_estimates_with_errors(double_gauss):
    spot = aplanat.analyze(double_gauss, "spot", error=1e-3)
    rms = spot.fields[0].rms
    assert isinstance(rms, aplanat.Estimate) and 0 < rms.error <= 2e-3 * rms.value
    assert rms.rays > 0 and rms.seconds > 0
    finer = aplanat.analyze(double_gauss, "spot", error=1e-6).fields[0].rms
    assert abs(finer.value - rms.value) <= rms.error + finer.error
    mtf = aplanat.analyze(double_gauss, "mtf", frequencies=[10, 30], field=0)
    assert len(mtf.fields) == 1
    with pytest.raises(AttributeError, match="no entry `nothing`"):
        mtf.nothing


def test_results_are_pickled(double_gauss):
    spot = aplanat.analyze(double_gauss, "spot")
    again = pickle.loads(pickle.dumps(spot))
    assert again == spot and again.fields[0].rms == spot.fields[0].rms


def test_commands_fail_as_on_the_command_line(double_gauss):
    with pytest.raises(aplanat.InputError, match="--error"):
        aplanat.analyze(double_gauss, "spot", error=7)
    with pytest.raises(aplanat.InputError, match="zoom position 3"):
        aplanat.analyze(double_gauss, "spot", zoom=3)
    with pytest.raises(aplanat.InputError, match="possible values"):
        aplanat.analyze(double_gauss, "nothing")


def test_commands_run_beside_each_other(double_gauss):
    results = []
    work = lambda: results.append(aplanat.analyze(double_gauss, "spot").fields[1].rms.value)
    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(results)) == 1 and len(results) == 4
