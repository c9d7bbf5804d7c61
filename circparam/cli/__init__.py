"""The command line: one file a command, loaded when it is called."""

from circparam.cli.group import COMMANDS, cli, main

__all__ = ["COMMANDS", "cli", "main"]
