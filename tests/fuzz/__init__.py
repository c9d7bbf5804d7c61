"""Fuzzing of the command line: ``python -m tests.fuzz``; a short form runs in tests/test_fuzz_short.py."""
