"""Lenses that the tests share."""

import pytest

import aplanat


@pytest.fixture
def singlet() -> aplanat.Lens:
    return aplanat.Lens.bundled("singlet_la1131")


@pytest.fixture
def double_gauss() -> aplanat.Lens:
    return aplanat.Lens.bundled("double_gauss_rudolph_50")
