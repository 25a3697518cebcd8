"""Publishers that are idle without a subscriber."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

#: Streams of state.
STATE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
#: Images: reliable, the newest two.
IMAGES = QoSProfile(depth=2, reliability=ReliabilityPolicy.RELIABLE)
#: Messages that late subscribers receive too.
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: The same as in tf2's broadcaster.
TRANSFORMS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


class Outputs:
    """The publishers of a node, by topic."""

    def __init__(self, node: Node):
        self._node = node
        self._publishers: dict[str, object] = {}
        self._silenced: frozenset[str] = frozenset()

    def declare(self, topic: str, kind: type, qos: QoSProfile = STATE) -> None:
        """Creates the publisher of a topic unless it exists."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(kind, topic, qos)

    def has_subscriber(self, topic: str) -> bool:
        """Whether a topic has a subscriber and is not silenced."""
        publisher = self._publishers.get(topic)
        if publisher is None or topic in self._silenced:
            return False
        return publisher.get_subscription_count() > 0

    def publish(self, topic: str, make: Callable[[], object]) -> None:
        """Publishes the message that ``make`` returns if the topic has a subscriber."""
        if self.has_subscriber(topic):
            self._publishers[topic].publish(make())

    def publish_latched(self, topic: str, message: object) -> None:
        """Publishes a latched message, also without a subscriber."""
        self._publishers[topic].publish(message)

    def silence_duplicates(self, topics: list[str]) -> None:
        """Silences those of ``topics`` that another node publishes too."""
        self._silenced = frozenset(
            topic
            for topic in topics
            if topic in self._publishers
            and self._node.count_publishers(self._publishers[topic].topic_name) > 1
        )
