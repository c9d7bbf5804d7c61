"""Messages over a pipe: bytes with their length before them."""

from typing import IO

LENGTH_BYTES = 8  # bytes that hold the length of a message


def send(stream: IO[bytes], data: bytes) -> None:
    """Write one message."""
    stream.write(len(data).to_bytes(LENGTH_BYTES, "little") + data)
    stream.flush()


def message(stream: IO[bytes]) -> bytes:
    """The next message of a stream; raises EOFError if it has ended."""
    return _exactly(stream, int.from_bytes(_exactly(stream, LENGTH_BYTES), "little"))


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data
