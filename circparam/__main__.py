"""``python -m circparam``."""

from __future__ import annotations

from circparam.cli import main

if __name__ == "__main__":
    main()
