"""A policy as a process: what it raises reaches its log and whoever asked."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from wheelarm import policy, v1


class Broken:
    """Raises in `infer`, or gives an exception in the place of rows."""

    def __init__(self, raises: bool) -> None:
        self.raises = raises

    def spec(self):
        return v1.PolicySpec(name="broken")

    def reset(self, request):
        pass

    def infer(self, observations):
        try:
            self.fail_in_my_code()
        except ValueError as problem:
            if self.raises:
                raise
            return [problem]

    def fail_in_my_code(self):
        raise ValueError("no such shape")


@pytest.mark.parametrize("raises", [True, False])
def test_traceback_of_a_policy_is_in_its_log_and_in_the_answer(raises, capfd):
    request = v1.InferRequest()
    request.observations.add(episode_key="e")
    sent = {}
    query = SimpleNamespace(
        key_expr="wheelarm/policy/p/infer",
        encoding=None,
        payload=SimpleNamespace(to_bytes=request.SerializeToString),
        reply=lambda key, payload, encoding: sent.update(reply=payload),
        reply_err=lambda payload, encoding: sent.update(failure=payload),
    )
    policy._answer(Broken(raises), query)
    if raises:
        told = v1.Failure.FromString(sent["failure"]).message
    else:
        told = v1.InferReply.FromString(sent["reply"]).chunks[0].problem
    assert told.splitlines()[0] == "ValueError: no such shape"
    log = capfd.readouterr().err
    for text in (told, log):
        assert "Traceback (most recent call last)" in text
        assert "in fail_in_my_code" in text
