"""What the file `metadata.yaml` of a rosbag2 declares: its parts, its messages and how long it lasts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

from skill.data.files import one_line, read_bounded
from skill.recordings.columns import listed

NAME = "metadata.yaml"

MAX_BYTES = 1_000_000
"""Largest size of the file; each topic takes some hundred bytes."""

TOLERANCE = 0.01, 1.0
"""How far the declared duration may be off: a share of it, and s. Messages that came late may count or not."""

REMEDY = "; copy what is missing, or let 'ros2 bag reindex' declare what is there"


@dataclass(frozen=True)
class BagMetadata:
    """What a bag declares of itself.

    Attributes:
        path: folder of the bag.
        parts: names of its files.
        counts: number of messages of each topic.
        duration: from the first message to the last, s.
    """

    path: Path
    parts: tuple[str, ...]
    counts: dict[str, int]
    duration: float

    @classmethod
    def find(cls, path: Path) -> BagMetadata | None:
        """Returns the metadata of a folder; None if it has none, or the path is a file.

        Raises:
            ValueError: if they are damaged.
        """
        file = path / NAME
        if not file.is_file():
            return None
        try:
            document = yaml.safe_load(read_bounded(file, MAX_BYTES))
            if not isinstance(document, dict) or "rosbag2_bagfile_information" not in document:
                return None  # of something else
            found = document["rosbag2_bagfile_information"]
            counts: dict[str, int] = {}
            for topic in found["topics_with_message_count"]:
                name = str(topic["topic_metadata"]["name"])
                counts[name] = counts.get(name, 0) + int(topic["message_count"])
            parts = tuple(Path(str(part)).name for part in found["relative_file_paths"])
            return cls(path, parts, counts, int(found["duration"]["nanoseconds"]) * 1e-9)
        except (OSError, ValueError, yaml.YAMLError, RecursionError, OverflowError) as error:
            reason = one_line(error)
        except (TypeError, KeyError):
            reason = "expected topics_with_message_count, relative_file_paths and duration.nanoseconds"
        raise ValueError(f"{file}: damaged ({reason}); 'ros2 bag reindex' writes it again")

    def check_parts(self, found: list[Path]) -> None:
        """Checks that the declared files are those that are there.

        Raises:
            ValueError: naming those that are missing, or are not declared.
        """
        there, declared = {part.name for part in found}, {part.removesuffix(".zstd") for part in self.parts}
        wrong = {"missing": sorted(declared - there), "not declared": sorted(there - declared)}
        if any(wrong.values()):
            names = "; ".join(f"{what}: {listed(parts)}" for what, parts in wrong.items() if parts)
            raise ValueError(f"{self.path}: {len(there)} files, but {NAME} declares {len(declared)}; {names}{REMEDY}")

    def check_messages(self, topic: str, count: int, duration: float) -> None:
        """Checks the number of messages of a topic, and the duration of the whole bag, s.

        Raises:
            ValueError: naming both numbers.
        """
        declared = self.counts.get(topic, 0)
        if count != declared:
            raise ValueError(
                f"{self.path}: {count} messages of topic '{topic}', but {NAME} declares {declared};"
                f" {abs(declared - count)} are {'missing' if count < declared else 'too many'}{REMEDY}"
            )
        share, least = TOLERANCE
        if abs(duration - self.duration) > max(least, share * self.duration):
            raise ValueError(
                f"{self.path}: its messages last {duration:.6g} s, but {NAME} declares {self.duration:.6g} s{REMEDY}"
            )
