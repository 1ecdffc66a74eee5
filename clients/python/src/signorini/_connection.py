"""Where the service is, and the settings of a connection to it; common to both clients."""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from urllib.parse import urlsplit

import httpx

from ._calls import Call

DEFAULT_URL = "http://127.0.0.1:8080"
READ_S = 30.0
"""Seconds that the service may take for an answer, besides those that it is asked to wait."""
PING_S = 15.0
"""An event stream is never silent for longer: the service sends a comment."""


@dataclass(frozen=True)
class Connection:
    url: str
    token: str | None
    retry_for: float

    @classmethod
    def of(cls, url: str | None, token: str | None, retry_for: float) -> Connection:
        """From the arguments of a client, or the environment."""
        url = url or os.environ.get("SIGNORINI_URL") or DEFAULT_URL
        if "://" not in url:
            url = "http://" + url
        return cls(url.rstrip("/"), token or os.environ.get("SIGNORINI_TOKEN") or None, retry_for)

    def settings(self) -> dict[str, Any]:
        """Of `httpx.Client` and `httpx.AsyncClient`."""
        headers = {"User-Agent": f"signorini-python/{package_version()}", "Accept": "application/json"}
        if self.token:
            headers["Authorization"] = f"Bearer {self.token}"
        return {
            "base_url": self.url,
            "headers": headers,
            "timeout": httpx.Timeout(READ_S, connect=10.0),
            # a proxy must not be asked for what is on this machine
            "trust_env": not is_loopback(self.url),
        }


def request_arguments(call: Call[Any]) -> Mapping[str, Any]:
    return {
        "method": call.method,
        "url": call.path,
        "params": list(call.params),
        "headers": dict(call.headers),
        "content": call.content,
        # longer than the service waits, so that its answer comes first
        "timeout": httpx.Timeout(READ_S + call.wait_s, connect=10.0),
    }


def stream_arguments(path: str, headers: Mapping[str, str]) -> Mapping[str, Any]:
    return {
        "method": "GET",
        "url": path,
        # compressed, an event could wait for the next one
        "headers": {**headers, "Accept-Encoding": "identity"},
        "timeout": httpx.Timeout(3 * PING_S, connect=10.0),
    }


def is_loopback(url: str) -> bool:
    host = urlsplit(url).hostname or ""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def package_version() -> str:
    try:
        return version("signorini")
    except PackageNotFoundError:  # used from its source
        return "0"
