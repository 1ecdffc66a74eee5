"""The token that `signorini login` keeps, and what a job says of its result."""

from __future__ import annotations

import json
import pathlib

import pytest

from signorini._connection import Connection
from signorini._job import JobView


def test_a_kept_token_is_used_for_its_service_only(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.delenv("SIGNORINI_TOKEN", raising=False)
    url = "https://lab.example"
    assert Connection.of(url, None, None).token == ""
    file = tmp_path / "signorini" / "tokens.json"
    file.parent.mkdir()
    file.write_text(json.dumps({url: "sgn_kept"}))
    file.chmod(0o600)
    for same in (url + "/", "HTTPS://Lab.Example", url + ":443/"):
        assert Connection.of(same, None, None).token == "sgn_kept", same
    for other in (url + ":8443", "http://lab.example", url + "/contact"):
        assert Connection.of(other, None, None).token == "", other
    # as earlier versions kept it
    file.write_text(json.dumps({"https://Lab.Example:443": "sgn_kept", "http://[::1]:80": "sgn_local"}))
    assert Connection.of(url, None, None).token == "sgn_kept"
    assert Connection.of("http://[::1]", None, None).token == "sgn_local"
    assert Connection.of("https://other.example", None, None).token == ""
    assert Connection.of(url, "sgn_given", None).token == "sgn_given"
    monkeypatch.setenv("SIGNORINI_TOKEN", "sgn_set")
    assert Connection.of(url, None, None).token == "sgn_set"
    monkeypatch.setenv("SIGNORINI_TOKEN", "")
    file.chmod(0o644)
    with pytest.raises(ValueError, match="chmod 600"):
        Connection.of(url, None, None)
    assert Connection.of("https://other.example", None, None).token == ""
    file.chmod(0o600)
    file.write_text(json.dumps(url) + "?")
    with pytest.raises(ValueError, match="is not what `signorini login` wrote"):
        Connection.of(url, None, None)


def test_a_job_has_the_verdict_on_its_result() -> None:
    force = {"quantity": "normal_force", "contact": "top", "value": 1.0, "error": 0.1}
    job = JobView({"verdict": "good", "quantities": [force]})
    assert job.verdict == "good" and job.quantities == [force]
    assert JobView({}).verdict is None and JobView({}).quantities == []
