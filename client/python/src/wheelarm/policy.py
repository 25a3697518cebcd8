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

It answers three queries below `wheelarm/policy/{name}/` and knows no server; whoever
evaluates it shows it what its spec asks for and carries its rows out.
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
from ._session import PREFIX, direct, open_session
from ._wire import check_encoding, check_name, encoding, read

#: Environment variables that tell a policy where to connect, and its name in the keys.
ENDPOINT_VARIABLE = "WHEELARM_POLICY_ENDPOINT"
NAME_VARIABLE = "WHEELARM_POLICY_NAME"
#: Questions that may wait.
WAITING = 64
#: What is asked, and what answers.
QUERIES = {
    "describe": (v1.PolicyDescribeRequest, "PolicySpec"),
    "reset": (v1.PolicyResetRequest, "PolicyResetReply"),
    "infer": (v1.InferRequest, "InferReply"),
}


@dataclass(frozen=True)
class Observation:
    """What one episode sees."""

    #: Names the episode among those that run at one time.
    episode_key: str
    #: Seed of its scenario; a policy that draws random numbers draws them from this
    #: and the tick.
    seed: int
    #: It is the first of its episode.
    first: bool
    #: Tick of the newest moment, 1/240 s.
    tick: int
    #: What the person says.
    instruction: str
    #: Rows of state, the newest last: [history, 27] float64; rad, rad/s, m.
    states: np.ndarray
    #: Colours by camera, the newest last: [height, width, 3] uint8.
    pictures: list[dict[str, np.ndarray]]
    #: Depth by camera where the spec asks for it: [height, width] float32, m, infinite
    #: where nothing is.
    depths: list[dict[str, np.ndarray]]

    @property
    def state(self) -> np.ndarray:
        """The newest row of state, [27] float64."""
        return self.states[-1]

    @staticmethod
    def read(message: Any) -> Observation:
        """Of a `PolicyObservation`."""

        def planes(moment: Any, plane: str) -> dict[str, np.ndarray]:
            out: dict[str, np.ndarray] = {}
            for picture in moment.pictures:
                data = getattr(picture, plane)
                if plane == "rgb":
                    pixels = np.frombuffer(data, np.uint8)
                    out[picture.camera] = pixels.reshape(picture.height, picture.width, 3)
                elif data:
                    metres = np.frombuffer(data, "<f4")
                    out[picture.camera] = metres.reshape(picture.height, picture.width)
            return out

        return Observation(
            episode_key=message.episode_key,
            seed=message.seed,
            first=message.first,
            tick=message.tick,
            instruction=message.instruction,
            states=np.array([list(moment.state_values) for moment in message.moments]),
            pictures=[planes(moment, "rgb") for moment in message.moments],
            depths=[planes(moment, "depth") for moment in message.moments],
        )


class Policy(Protocol):
    """What answers for a robot."""

    def spec(self) -> Any:
        """What it wants and answers: a `v1.PolicySpec`."""

    def reset(self, request: Any) -> None:
        """An episode begins: a `v1.PolicyResetRequest`."""

    def infer(self, observations: list[Observation]) -> list[Any]:
        """Rows for every observation, [rows, 12] (or 9) in the units of the spec; an
        exception in the place of an array ends that episode alone, with its words."""


def serve(policy: Policy, endpoint: str | None = None, name: str | None = None) -> None:
    """Answers whoever asks, until the process is ended.

    Args:
        endpoint: Zenoh endpoint of whoever asks; told by `WHEELARM_POLICY_ENDPOINT`
            when `wheelarm evaluate` starts this program.
        name: its name in the keys; told by `WHEELARM_POLICY_NAME`, else `policy`.

    Raises:
        NoServer: when nobody listens at the endpoint.
        ValueError: when no endpoint is told.
    """
    endpoint = endpoint or os.environ.get(ENDPOINT_VARIABLE)
    if not endpoint:
        raise ValueError(
            f"say where to connect: serve(policy, endpoint=...), or {ENDPOINT_VARIABLE}; "
            "`wheelarm evaluate --policy exec:COMMAND` sets it"
        )
    name = check_name(name or os.environ.get(NAME_VARIABLE) or "policy")
    session = open_session(endpoint, timeout=10.0)
    asked: queue.Queue[Any] = queue.Queue(WAITING)

    def take(query: Any) -> None:
        # Whoever asks more than waits here is not answered.
        try:
            asked.put_nowait(query)
        except queue.Full:
            query.drop()

    prefix = f"{PREFIX}/policy/{name}"
    queryables = [session.declare_queryable(f"{prefix}/{q}", direct(take)) for q in QUERIES]
    token = session.liveliness().declare_token(f"{prefix}/alive")
    try:
        while not session.is_closed():
            try:
                query = asked.get(timeout=1.0)
            except queue.Empty:
                continue
            _answer(policy, query)
            query.drop()
    finally:
        token.undeclare()
        for queryable in queryables:
            queryable.undeclare()
        session.close()


def _answer(policy: Policy, query: Any) -> None:
    key = str(query.key_expr)
    which = key.rsplit("/", 1)[1]
    request_class, reply_class = QUERIES[which]
    try:
        if query.encoding is not None:
            check_encoding(str(query.encoding))
        payload = query.payload.to_bytes() if query.payload is not None else b""
        request = read(request_class, payload, which)
        reply = _reply(policy, which, request)
    except Exception as problem:
        failure = v1.Failure(message=_told(problem))
        query.reply_err(failure.SerializeToString(), encoding=encoding("Failure"))
        return
    query.reply(key, reply.SerializeToString(), encoding=encoding(reply_class))


def _told(problem: BaseException) -> str:
    """An exception in one line, and its traceback below, which also goes to standard error:
    the `policy.log` of `wheelarm evaluate`."""
    trace = "".join(traceback.format_exception(problem)).rstrip()
    print(trace, file=sys.stderr, flush=True)
    return f"{type(problem).__name__}: {problem}\n{trace}"


def _reply(policy: Policy, which: str, request: Any) -> Any:
    if which == "describe":
        return policy.spec()
    if which == "reset":
        policy.reset(request)
        return v1.PolicyResetReply()
    observations = [Observation.read(message) for message in request.observations]
    answers = policy.infer(observations)
    if len(answers) != len(observations):
        raise ValueError(f"{len(answers)} answers to {len(observations)} observations")
    reply = v1.InferReply()
    for observation, rows in zip(observations, answers, strict=True):
        chunk = reply.chunks.add(episode_key=observation.episode_key, tick=observation.tick)
        if isinstance(rows, Exception):
            chunk.problem = _told(rows)
            continue
        rows = np.asarray(rows, np.float32)
        if rows.ndim != 2:
            chunk.problem = f"the answer has the shape {rows.shape}, expected [rows, numbers]"
            continue
        chunk.rows = len(rows)
        chunk.values.extend(rows.ravel().tolist())
    return reply
