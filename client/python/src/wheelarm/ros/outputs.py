"""Publishers that do nothing while nobody listens."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

#: Streams of state.
STATE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
#: Pictures: reliable, the newest two.
PICTURES = QoSProfile(depth=2, reliability=ReliabilityPolicy.RELIABLE)
#: What is told once and kept for who comes later.
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: As tf2's broadcaster has it.
TRANSFORMS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


class Outputs:
    """The publishers of a node, by topic."""

    def __init__(self, node: Node):
        self._node = node
        self._publishers: dict[str, object] = {}
        self._yielded: frozenset[str] = frozenset()

    def declare(self, topic: str, kind: type, qos: QoSProfile = STATE) -> None:
        """Opens a topic; once open it stays."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(kind, topic, qos)

    def is_wanted(self, topic: str) -> bool:
        """Whether somebody subscribes to it."""
        publisher = self._publishers.get(topic)
        if publisher is None or topic in self._yielded:
            return False
        return publisher.get_subscription_count() > 0

    def put(self, topic: str, make: Callable[[], object]) -> None:
        """Publishes what ``make`` gives, if somebody subscribes."""
        if self.is_wanted(topic):
            self._publishers[topic].publish(make())

    def keep(self, topic: str, message: object) -> None:
        """Publishes a latched message, whoever subscribes now."""
        self._publishers[topic].publish(message)

    def yield_to_others(self, topics: list[str]) -> None:
        """Is silent on those of ``topics`` that somebody else publishes too."""
        self._yielded = frozenset(
            topic
            for topic in topics
            if topic in self._publishers
            and self._node.count_publishers(self._publishers[topic].topic_name) > 1
        )
