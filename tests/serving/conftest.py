"""A client without proxies, and a server that always says the same."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest
from scripted_backend import Scripted, serving

from unilavira_drake.serving import ModelServer


@pytest.fixture
def client() -> Iterator[httpx.Client]:
    with httpx.Client(trust_env=False, timeout=20.0) as http:
        yield http


@pytest.fixture
def echo() -> Iterator[tuple[Scripted, ModelServer]]:
    backend = Scripted(lambda request: '{"said": 1}')
    with serving(backend) as server:
        yield backend, server
