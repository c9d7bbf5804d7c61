"""``python -m circparam``."""

from circparam.cli import main

if __name__ == "__main__":
    main()
