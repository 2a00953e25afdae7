"""Clients of the server that runs."""

import os

import pytest

import grasp


@pytest.fixture(scope="session")
def address():
    return os.environ["GRASP_ADDRESS"]


@pytest.fixture(scope="session")
def client(address):
    with grasp.Client(address) as opened:
        yield opened
