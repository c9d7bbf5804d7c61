"""``python -m tests.bench [NAME] ...``: the benchmark of that name, a module of this folder; solve if none."""

import importlib
import sys

NAMES = (
    "solve", "atlas", "packing", "speed", "scale", "batch", "front", "maps", "look", "noise", "hand",
)  # fmt: skip


def main() -> None:
    """Hand over to the benchmark of that name."""
    named = sys.argv[1:2] and sys.argv[1] in NAMES
    name = sys.argv.pop(1) if named else "solve"
    sys.argv[0] = f"python -m tests.bench {name}"
    sys.exit(importlib.import_module(f"tests.bench.{name}").main())


if __name__ == "__main__":
    main()
