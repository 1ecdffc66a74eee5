"""Where the service is, and the settings of a connection to it; common to both clients."""

from __future__ import annotations

import ipaddress
import json
import os
import pathlib
import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from urllib.parse import urlsplit

import certifi
import httpx

from ._calls import Call

DEFAULT_URL = "http://127.0.0.1:8080"
READ_S = 30.0
"""Seconds that the service may take for an answer, besides those that it is asked to wait."""
PING_S = 15.0
"""An event stream is never silent for longer: the service sends a comment."""


def _address(url: str) -> str:
    """The address of a service in the form that its token is kept under: the host in lower case, without the port that
    its scheme has anyway, and without a slash at the end."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return url.rstrip("/")
    host = (parts.hostname or "").lower()
    host = f"[{host}]" if ":" in host else host
    user = parts.netloc.rpartition("@")[0]
    usual = {"http": 80, "https": 443}.get(parts.scheme)
    place = (f"{user}@" if user else "") + host + (f":{port}" if port not in (None, usual) else "")
    return parts._replace(netloc=place).geturl().rstrip("/")


def _kept_token(url: str) -> str:
    """The token that `signorini login` has kept for a service, or an empty text. ValueError: others can read it."""
    folder = os.environ.get("XDG_CONFIG_HOME") or os.path.join(os.path.expanduser("~"), ".config")
    path = pathlib.Path(folder, "signorini", "tokens.json")
    try:
        text = path.read_text(encoding="utf-8")
        mode = path.stat().st_mode
    except OSError:
        return ""
    wanted = _address(url)
    try:
        kept = json.loads(text)
    except ValueError as error:
        # a file that has nothing for this service stops nobody
        if wanted not in text:
            return ""
        raise ValueError(f"{path} is not what `signorini login` wrote: {error}") from None
    # earlier versions kept addresses as they were written
    tokens = {_address(str(of)): str(token) for of, token in kept.items()} if isinstance(kept, dict) else {}
    if wanted not in tokens:
        return ""
    if mode & 0o077:
        raise ValueError(f"others can read {path}, which has tokens: chmod 600 {path}, and rotate them")
    return tokens[wanted]


@dataclass(frozen=True)
class Connection:
    url: str
    token: str
    """Empty without one."""
    ca: str
    """Path of a certificate authority's certificates; empty for those of the machine."""

    @classmethod
    def of(cls, url: str | None, token: str | None, ca: str | os.PathLike[str] | None) -> Connection:
        """From the arguments of a client, or the environment where one is None. ValueError: what cannot be."""
        url = url or os.environ.get("SIGNORINI_URL") or DEFAULT_URL
        if "://" not in url:
            url = "http://" + url
        if urlsplit(url).scheme not in ("http", "https"):
            raise ValueError(f"the address of the service begins with http:// or https://, not {url!r}")
        if token is None:
            token = os.environ.get("SIGNORINI_TOKEN") or _kept_token(url)
        # read from a file, it ends with a line break; messages about an invalid token do not contain the token
        token = token.strip()
        if not (token.isascii() and token.isprintable()):
            raise ValueError("the token has characters that no token has: was it copied whole, and nothing else?")
        if ca is None:
            ca = os.environ.get("SIGNORINI_CA", "")
        return cls(url.rstrip("/"), token, os.fspath(ca))

    def settings(self) -> dict[str, Any]:
        """Of `httpx.Client` and `httpx.AsyncClient`; made once, since reading certificates takes its time."""
        headers = {"User-Agent": f"signorini-python/{package_version()}", "Accept": "application/json"}
        if self.token:
            headers["Authorization"] = f"Bearer {self.token}"
        return {
            "base_url": self.url,
            "headers": headers,
            "timeout": httpx.Timeout(READ_S, connect=10.0),
            "verify": self._trusted(),
            # a proxy must not be asked for what is on this machine
            "trust_env": not is_loopback(self.url),
        }

    def _trusted(self) -> ssl.SSLContext:
        """Whom a service over https may have its certificate from."""
        if not self.url.startswith("https://"):
            return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # of no use, and made at once
        if self.ca:
            try:
                return ssl.create_default_context(cafile=self.ca)
            except OSError as error:  # an SSLError is one, too
                raise ValueError(
                    f"the file of a certificate authority, {self.ca!r}, cannot be used: {error}"
                ) from error
        # those of the machine, and those that Python's packages bring, which a machine may not have
        context = ssl.create_default_context()
        context.load_verify_locations(certifi.where())
        return context


def request_arguments(call: Call[Any]) -> Mapping[str, Any]:
    """Of `Pool.call` and `AsyncPool.call`."""
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
