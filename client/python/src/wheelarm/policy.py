"""A policy as a process: `wheelarm evaluate --policy "exec:python my_policy.py"`.

    import numpy as np
    from wheelarm import policy, v1

    class Hold:
        def spec(self):
            return v1.PolicySpec(name="hold", rate_hz=10, chunk=1, execute=1)

        def reset(self, request):
            pass

        def infer(self, observations):
            return [np.concatenate([o.state[14:23], [o.state[12], 0, 0]])[None] for o in observations]

    policy.serve(Hold())

The process replies to three queries below `wheelarm/policy/{name}/` and has no connection
to a simulator. The evaluation sends the observations that the spec requires, and executes
the rows.
"""

from __future__ import annotations

import os
import queue
import sys
import traceback
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from . import v1
from ._contract import PREFIX
from ._session import direct_callback, open_session
from ._wire import check_encoding, check_name, encoding, read

#: Environment variables with the endpoint, and with the name of the policy in the keys.
ENDPOINT_VARIABLE = "WHEELARM_POLICY_ENDPOINT"
NAME_VARIABLE = "WHEELARM_POLICY_NAME"
#: Capacity of the request queue (count).
MAX_QUEUED = 64
#: Query: class of the request, name of the reply.
QUERIES = {
    "describe": (v1.PolicyDescribeRequest, "PolicySpec"),
    "reset": (v1.PolicyResetRequest, "PolicyResetReply"),
    "infer": (v1.InferRequest, "InferReply"),
}


@dataclass(frozen=True)
class Observation:
    """Observation of one episode."""

    #: Id of the episode among those that run at the same time.
    episode_key: str
    #: Seed of the scenario. A policy with random numbers samples them from this seed and the
    #: tick.
    seed: int
    #: Whether it is the first observation of its episode.
    first: bool
    #: Tick of the newest moment, 1/240 s.
    tick: int
    #: Instruction sentence.
    instruction: str
    #: Rows of state, the newest last: [history, 27] float64; rad, rad/s, m.
    states: np.ndarray
    #: Color images by camera, the newest last: [height, width, 3] uint8.
    images: list[dict[str, np.ndarray]]
    #: Depth images by camera if the spec requests them: [height, width] float32, m, infinite
    #: without a surface.
    depths: list[dict[str, np.ndarray]]

    @property
    def state(self) -> np.ndarray:
        """The newest row of state, [27] float64."""
        return self.states[-1]

    @staticmethod
    def from_proto(message: Any) -> Observation:
        """Converts a `PolicyObservation`."""

        def images_of(step: Any, plane: str) -> dict[str, np.ndarray]:
            out: dict[str, np.ndarray] = {}
            for image in step.images:
                data = getattr(image, plane)
                if plane == "color":
                    pixels = np.frombuffer(data, np.uint8)
                    out[image.camera] = pixels.reshape(image.height, image.width, 3)
                elif data:
                    metres = np.frombuffer(data, "<f4")
                    out[image.camera] = metres.reshape(image.height, image.width)
            return out

        return Observation(
            episode_key=message.episode_key,
            seed=message.seed,
            first=message.first,
            tick=message.tick,
            instruction=message.instruction,
            states=np.array([list(step.state_values) for step in message.steps]),
            images=[images_of(step, "color") for step in message.steps],
            depths=[images_of(step, "depth") for step in message.steps],
        )


class Policy(Protocol):
    """Interface of a policy."""

    def spec(self) -> Any:
        """Inputs and outputs of the policy, a `v1.PolicySpec`."""

    def reset(self, request: Any) -> None:
        """Called at the start of an episode with a `v1.PolicyResetRequest`."""

    def infer(self, observations: list[Observation]) -> list[Any]:
        """Rows for every observation, [rows, 12] (or 9) in the units of the spec. An
        exception in the place of an array ends only that episode, with its message."""


def serve(policy: Policy, endpoint: str | None = None, name: str | None = None) -> None:
    """Replies to queries until the process ends.

    Args:
        policy: The policy.
        endpoint: Zenoh endpoint to connect to; the value of `WHEELARM_POLICY_ENDPOINT` if
            absent, which `wheelarm evaluate` sets.
        name: Name in the keys; the value of `WHEELARM_POLICY_NAME` if absent, else `policy`.

    Raises:
        NoServerError: when no process listens at the endpoint.
        ValueError: without an endpoint.
    """
    endpoint = endpoint or os.environ.get(ENDPOINT_VARIABLE)
    if not endpoint:
        raise ValueError(
            f"no endpoint to connect to: give serve(policy, endpoint=...), or set "
            f"{ENDPOINT_VARIABLE}; `wheelarm evaluate --policy exec:COMMAND` sets it"
        )
    name = check_name(name or os.environ.get(NAME_VARIABLE) or "policy")
    session = open_session(endpoint, timeout=10.0)
    requests: queue.Queue[Any] = queue.Queue(MAX_QUEUED)

    def enqueue(query: Any) -> None:
        # A full queue drops further queries.
        try:
            requests.put_nowait(query)
        except queue.Full:
            query.drop()

    prefix = f"{PREFIX}/policy/{name}"
    queryables = [
        session.declare_queryable(f"{prefix}/{q}", direct_callback(enqueue)) for q in QUERIES
    ]
    token = session.liveliness().declare_token(f"{prefix}/alive")
    try:
        while not session.is_closed():
            try:
                query = requests.get(timeout=1.0)
            except queue.Empty:
                continue
            _reply_to(policy, query)
            query.drop()
    finally:
        token.undeclare()
        for queryable in queryables:
            queryable.undeclare()
        session.close()


def _reply_to(policy: Policy, query: Any) -> None:
    key = str(query.key_expr)
    which = key.rsplit("/", 1)[1]
    request_class, reply_class = QUERIES[which]
    try:
        if query.encoding is not None:
            check_encoding(str(query.encoding))
        payload = query.payload.to_bytes() if query.payload is not None else b""
        request = read(request_class, payload, which)
        reply = _make_reply(policy, which, request)
    except Exception as error:
        failure = v1.Failure(message=_log_error(error))
        query.reply_err(failure.SerializeToString(), encoding=encoding("Failure"))
        return
    query.reply(key, reply.SerializeToString(), encoding=encoding(reply_class))


def _log_error(error: BaseException) -> str:
    """Writes the traceback of an exception to standard error, the `policy.log` of
    `wheelarm evaluate`. Returns the exception in one line, followed by the traceback."""
    trace = "".join(traceback.format_exception(error)).rstrip()
    print(trace, file=sys.stderr, flush=True)
    return f"{type(error).__name__}: {error}\n{trace}"


def _make_reply(policy: Policy, which: str, request: Any) -> Any:
    if which == "describe":
        return policy.spec()
    if which == "reset":
        policy.reset(request)
        return v1.PolicyResetReply()
    observations = [Observation.from_proto(message) for message in request.observations]
    answers = policy.infer(observations)
    if len(answers) != len(observations):
        raise ValueError(
            f"infer returned {len(answers)} results for {len(observations)} observations: return "
            "one for each"
        )
    reply = v1.InferReply()
    for observation, rows in zip(observations, answers, strict=True):
        chunk = reply.chunks.add(episode_key=observation.episode_key, tick=observation.tick)
        if isinstance(rows, Exception):
            chunk.problem = _log_error(rows)
            continue
        rows = np.asarray(rows, np.float32)
        if rows.ndim != 2:
            chunk.problem = f"infer returned the shape {rows.shape}: expected [rows, numbers]"
            continue
        chunk.rows = len(rows)
        chunk.values.extend(rows.ravel().tolist())
    return reply
