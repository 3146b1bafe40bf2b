"""Fixtures: one small capture for all tests."""

import os

import pytest

import thirdbounce as tb

# A short solve that repeats bit by bit.
SHORT = {"model": "cosine", "lateral": 16, "iterations": 12, "deterministic": True}


@pytest.fixture(scope="session")
def rendered():
    """A capture of a letter at 8 x 8 points, and its truth."""
    return tb.simulate("letter-Z", scan=8, bin_width=0.02, noise=0.2, truth_pixels=32)


@pytest.fixture(scope="session")
def capture(rendered):
    return rendered[0]


@pytest.fixture(scope="session")
def maps(capture):
    return tb.reconstruct(capture, **SHORT)


@pytest.fixture(scope="session")
def command():
    """The command, for comparison."""
    path = os.environ.get("THIRDBOUNCE")
    if path is None:
        pytest.skip("THIRDBOUNCE does not name the command")
    return path
