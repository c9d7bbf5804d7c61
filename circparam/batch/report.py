"""The report of a folder of results: a page that needs nothing else, and all figures as CSV beside it."""

import contextlib
import csv
import functools
import io
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from circparam.batch.index import STORED_FIGURES, Index
from circparam.batch.progress import LINE_STATUSES, printable
from circparam.batch.store import Folder, again, open_store
from circparam.core.types import FloatArray
from circparam.formats.io import read
from circparam.render import colours as col
from circparam.render.compare_page import png_url
from circparam.render.scene import make_scene
from circparam.render.side_by_side import draw_layouts
from circparam.render.templates import document as whole_page
from circparam.render.templates import fill_in, page_style, piece, viewer_file

PAGE_NAME, TABLE_NAME = "report.html", "report.csv"
MOST_TABLE_ROWS = 10_000  # of the table in the page; report.csv has all
MOST_TABLE_BYTES = 3_500_000  # of those rows, so that the page stays below 5 MB
SHOWN_FILES = 8  # slowest and worst files with a picture
MOST_CAUSES = 25
HISTOGRAM_BINS = 28
TITLES = {
    "charts": "charts",
    "seam_length": "seam / √area",
    "distortion": "distortion",
    "stretch_p99": "stretch, 99 %",
    "pack": "covered %",
    "seconds": "seconds",
    "peak_memory": "memory, MB",
}
_SCALE = {"pack": 100.0, "peak_memory": 1e-6}
_WORST = (
    "status = 'degraded' DESC, coalesce(share_over_2, 0) > 0.001 DESC, coalesce(share_over_2, 0) DESC, "
    "seam_length DESC"
)
_DRAWABLE = "output_bytes IS NOT NULL AND status != 'failed'"
THUMBNAIL_PIXELS = 170  # pixels of a picture
LARGEST_RESULT_BYTES = 64_000_000  # bytes of a result that is read for a picture


def save_report(folder: Folder, index: Index) -> str:
    """Write report.html and report.csv; returns the address of the page. Raises OutputError."""
    names = ["name", "source", "status", "exit", "cause", "output_bytes", *STORED_FIGURES]
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(names)
    for row in index.data.execute(f"SELECT {', '.join(names)} FROM done ORDER BY name"):
        writer.writerow([readable(v) if isinstance(v, bytes) else v for v in row])
    table = text.getvalue().encode("utf-8", "backslashreplace")
    page = report_page(folder, index).encode("utf-8", "backslashreplace")
    folder.put_bytes(TABLE_NAME, table)
    folder.put_bytes(PAGE_NAME, page)
    return folder.of(PAGE_NAME)


def report_page(folder: Folder, index: Index) -> str:
    """The page as text."""
    counts, _, missed = index.counts()
    plots = "".join(_histogram(index, name) for name in TITLES)
    sections = [
        _counts(counts, missed),
        _causes(index),
        _section("Distributions", plots and f'<div class="histograms">{plots}</div>'),
        _cards(folder, index),
    ]
    rows, cut = _rows(index)
    note = f"The {len(rows):,} that failed, degraded or took longest; {TABLE_NAME} has all."
    heads = ["name", "status", "exit", "faces", *TITLES.values(), "tries", "cause"]
    columns = [{"name": n, "numeric": n not in ("name", "status", "cause")} for n in heads]
    data = json.dumps(
        {"heads": columns, "kinds": LINE_STATUSES, "rows": rows}, separators=(",", ":")
    )
    colours = {"WARN": col.CHARTS[5], **{kind.upper(): _COLOURS[kind] for kind in LINE_STATUSES}}
    return whole_page(
        f"Batch: {sum(counts.values()):,} meshes",
        readable(folder.address.encode("utf-8", "surrogateescape")),
        page_style("compare.css") + fill_in(viewer_file("batch.css"), **colours),
        fill_in(
            viewer_file("batch.html"),
            SECTIONS="\n".join(filter(None, sections)),
            ROWS_NOTE=note if cut else "",
            DATA=data.replace("<", "\\u003c"),
        ),
        viewer_file("batch.js"),
    )


_COLOURS = {kind: col.CHARTS[k] for kind, k in zip(LINE_STATUSES, (2, 4, 1, 5), strict=True)}


def _section(title: str, content: str) -> str:
    """A section of the page; none without content."""
    return piece("titled", title=title, CONTENT=content) if content else ""


def _counts(counts: dict[str, int], missed: int) -> str:
    shown = [(counts.get(k, 0), piece("dot", kind=k), k) for k in LINE_STATUSES]
    shown += [(missed, "", "missed a gate")] if missed else []
    tiles = "".join(piece("tile", count=f"{n:,}", DOT=dot, label=text) for n, dot, text in shown)
    bar = "".join(piece("share", kind=k, count=counts[k]) for k in LINE_STATUSES if counts.get(k))
    return _section("Status", piece("status", TILES=tiles, BAR=bar))


def _causes(index: Index) -> str:
    """Failures and missed gates by cause; file names are no part of a cause."""
    found: dict[str, list[Any]] = {}
    query = "SELECT name, source, exit, cause FROM done WHERE exit != 0 ORDER BY name"
    for name, source, code, cause in index.data.execute(query):
        text = readable(cause).replace(readable(source), "").replace(readable(name), "")
        entry = found.setdefault(
            f"{code} {text.lstrip(': ')[:200]}", [0, code, text.lstrip(": "), name]
        )
        entry[0] += 1
    if not found:
        return ""
    rows = "".join(
        piece("cause", count=f"{n:,}", code=code, cause=text[:400], name=readable(name))
        for n, code, text, name in sorted(found.values(), key=lambda e: -e[0])[:MOST_CAUSES]
    )
    more = f"<p>and {len(found) - MOST_CAUSES} causes more</p>" if len(found) > MOST_CAUSES else ""
    return _section("What went wrong", piece("causes", ROWS=rows, MORE=more))


def _histogram(index: Index, name: str) -> str:
    """Bars over equal steps, of the logarithm where values spread widely."""
    found = index.data.execute(f"SELECT {name} FROM done WHERE {name} IS NOT NULL")
    values = np.fromiter((row[0] for row in found), np.float64) * _SCALE.get(name, 1.0)
    if not len(values):
        return ""
    low, middle, high = (float(v) for v in np.percentile(values, [0, 50, 100]))
    log = low > 0 and high > 30 * low and name != "pack"  # a share is read as it is
    edges: FloatArray = (np.geomspace if log else np.linspace)(low, high, HISTOGRAM_BINS + 1)
    edges[0], edges[-1] = low, high
    if high <= low:
        edges = np.array([low - 0.5, low + 0.5])
    counts, _ = np.histogram(values, edges)
    tallest = max(int(counts.max()), 1)
    step = 260 / len(counts)
    bars = ""
    for k, n in enumerate(counts.tolist()):
        if n:
            size = {"width": f"{step - 1:.1f}", "height": f"{84 * n / tallest:.1f}"}
            place = {"x": f"{k * step:.1f}", "y": f"{92 - 84 * n / tallest:.1f}"}
            ends = {"a": figure(edges[k]), "b": figure(edges[k + 1])}
            bars += piece("bar", **place, **size, **ends, count=f"{n:,}")
    return piece(
        "histogram", title=TITLES[name], middle=figure(middle), most=figure(np.percentile(values, 95)),
        largest=figure(high), BARS=bars, low=figure(edges[0]), high=figure(edges[-1]),
        scale=" (log)" if log else "",
    )  # fmt: skip


def figure(value: float) -> str:
    """Three digits of a number, or all before the point."""
    return f"{value:.3g}" if abs(value) < 999.5 else f"{value:,.0f}"


def _cards(folder: Folder, index: Index) -> str:
    """The slowest and the worst files with a picture and their cause."""
    out = ""
    # the slowest are often among the worst
    pictures = functools.cache(functools.partial(thumbnails, folder))
    for title, order in (("Slowest", "seconds DESC"), ("Worst", _WORST)):
        query = (
            f"SELECT name, status, faces, charts, seconds, seam_length, share_over_2, distortion, stage, cause "
            f"FROM done WHERE {_DRAWABLE} ORDER BY {order}, name LIMIT {SHOWN_FILES}"
        )
        cards = "".join(_card(pictures, title, row) for row in index.data.execute(query).fetchall())
        out += _section(title, cards and f'<div class="cards">{cards}</div>')
    return out


def _card(pictures: Callable[[str], list[str]], title: str, row: tuple[Any, ...]) -> str:
    name, status, faces, charts, seconds, seam, over, distortion, stage, cause = row
    text = name.decode("utf-8", "surrogateescape")
    badge = "" if status == "ok" else piece("badge", status=status)
    if title == "Slowest":
        why = f"{seconds:.3g} s for {faces:,.0f} faces; {stage}".replace(" s", "\u00a0s")
    elif status == "degraded":
        why = readable(cause)
    else:
        over = f", {100 * over:.2g} % stretched over 2" if over else ""
        parts = f"{charts:.0f} chart{'s' * (charts != 1)}, seam {seam or 0:.3g}"
        why = f"{parts}, distortion {distortion or 0:.4g}{over}"
    if images := pictures(text):
        picture = piece("drawn", surface=images[0], layout=images[1])
    else:
        picture = piece("empty", reason="no picture")
    return piece("file", name=readable(name), BADGE=badge, PICTURE=picture, why=why)


def _rows(index: Index) -> tuple[list[list[Any]], bool]:
    """Rows of the table, those that need attention first; whether there are more."""
    names = ", ".join(TITLES)
    query = (
        f"SELECT name, status, exit, faces, {names}, attempts, cause FROM done ORDER BY exit != 0 DESC, "
        "status = 'degraded' DESC, seconds DESC, name"
    )
    rows: list[list[Any]] = []
    size = 0
    for row in index.data.execute(query):
        name, status, code, faces, *figures, attempts, cause = row
        cells = [
            None if v is None else float(f"{v * _SCALE.get(k, 1.0):.5g}")
            for k, v in zip(TITLES, figures, strict=True)
        ]
        line = [
            readable(name), LINE_STATUSES.index(status), code, None if faces is None else int(faces),
            *(int(c) if c is not None and c == int(c) else c for c in cells),
            attempts, readable(cause)[:300],
        ]  # fmt: skip
        size += len(json.dumps(line))
        if len(rows) >= MOST_TABLE_ROWS or size > MOST_TABLE_BYTES:
            return rows, True
        rows.append(line)
    return rows, False


def readable(key: bytes) -> str:
    """A name as text for people: invalid UTF-8 and control characters become escapes."""
    return printable(key.decode("utf-8", "backslashreplace"))


def thumbnails(folder: Folder, name: str) -> list[str]:
    """Surface and layout of a result as data addresses; none if it cannot be drawn."""
    with contextlib.suppress(Exception), _local(folder, name) as path:
        if os.path.getsize(path) > LARGEST_RESULT_BYTES:
            return []
        document = read(path)
        uvmap = document.uv(document.uv_sets[-1]) if document.uv_sets else None
        if uvmap is None:
            return []
        scene = make_scene(document.mesh.points, document.mesh.faces, uvmap.uv, uvmap.uv_faces)
        for layout, checker, _ in filter(None, draw_layouts([scene], THUMBNAIL_PIXELS)):
            return [png_url(checker), png_url(layout)]
    return []


@contextlib.contextmanager
def _local(folder: Folder, name: str) -> Iterator[str]:
    """The path of a result on this machine."""
    if not folder.remote:
        yield folder.of(name)
        return
    store, root = open_store(folder.address)
    with tempfile.TemporaryDirectory(prefix="circparam-batch-picture-") as scratch:
        path = os.path.join(scratch, os.path.basename(name))
        again(store.get_file, f"{root}/{name}", path)
        yield path
