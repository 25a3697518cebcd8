"""A policy as a process: its exceptions reach its log and the client."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from wheelarm import policy, v1


class Broken:
    """Raises in `infer`, or returns an exception in the place of rows."""

    def __init__(self, raises: bool) -> None:
        self.raises = raises

    def spec(self):
        return v1.PolicySpec(name="broken")

    def reset(self, request):
        pass

    def infer(self, observations):
        try:
            self.fail_in_my_code()
        except ValueError as error:
            if self.raises:
                raise
            return [error]

    def fail_in_my_code(self):
        raise ValueError("no such shape")


@pytest.mark.parametrize("raises", [True, False])
def test_traceback_of_a_policy_is_in_its_log_and_in_the_reply(raises, capfd):
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
    policy._reply_to(Broken(raises), query)
    if raises:
        problem = v1.Failure.FromString(sent["failure"]).message
    else:
        problem = v1.InferReply.FromString(sent["reply"]).chunks[0].problem
    assert problem.splitlines()[0] == "ValueError: no such shape"
    log = capfd.readouterr().err
    for text in (problem, log):
        assert "Traceback (most recent call last)" in text
        assert "in fail_in_my_code" in text
