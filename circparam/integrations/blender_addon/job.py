"""One run of the program on the parts of one page: its words, its files, its result in Blender."""

import numpy as np

from .exchange import Failure, numbers, read_uv, write_obj


class Job:
    """Some parts that share a page, from the file that the program reads to uv in Blender.

    asked: the properties of the operator. Polygons that are not chosen keep their uv to the bit. If such
    polygons cover part of the page, the program gets the whole meshes and finds room beside them.
    """

    def __init__(self, parts, asked):
        self.parts, self.asked = parts, asked
        self.names = ", ".join(p.name for p in parts if p.chosen.any())
        self._packs = asked.action == "PACK"
        self._held = (
            not self._packs
            and asked.pins == "POINTS"
            and any(p.pinned[p.corners].any() for p in parts)
        )
        self._beside = not self._held and any(p.page_in_use for p in parts)
        self._polygons = [p.chosen | self._beside for p in parts]

    def words(self, stem):
        """Write the files of the job; returns the words after the program's name."""
        asked, self._output = self.asked, stem + "_uv.obj"
        # options that lay out a whole page have no sense where only some of its charts are laid out
        kinds = ["straight"] if self._held else []
        kinds += ["density"] if self._beside else []
        words = words_of(self.asked, "sorting", *kinds)
        if words and (self._held or self._beside):
            raise Failure(
                f"{words[0]} lays out a whole page: select all faces and hold no points, or switch it off"
            )
        hints = (
            not self._packs and asked.seams == "HINT" and any(p.marks().any() for p in self.parts)
        )
        uv = [p.uv for p in self.parts] if self._packs or self._beside else None
        if hints:
            uv = [_hinted(p) for p in self.parts]
        axis = 1 if asked.symmetry == "Z" else 2
        first = write_obj(stem + ".obj", self.parts, axis, uv, self._polygons)
        command = "pack" if self._packs else "unwrap"
        words = [command, stem + ".obj", "-o", self._output, "--json"]
        words += words_of(asked, "sorting", "straight", "density")
        if not self._held:
            words += words_of(asked, "packing")
        if asked.density and not self._held and not (self._packs and self._beside):
            words += ["--texel-density", f"{asked.density:.9g}"]
        if self._beside:
            chosen = np.concatenate([p.chosen for p in self.parts])
            flag, faces = ("--lock", ~chosen) if self._packs else ("--only", chosen)
            words += _file(flag, stem + ".faces", np.flatnonzero(faces), "%d")
            words += words_of(asked, "room")
        if self._packs:
            return words
        words += words_of(asked, "charts")
        if hints:
            words.append("--keep-uv-seams")
        if asked.seams == "MUST":
            pairs = [_marked_pairs(p, n) for p, n in zip(self.parts, first, strict=True)]
            words += _file("--seams", stem + ".seams", np.concatenate(pairs), "%d %d")
        if asked.seam_group:
            rows = _weight_rows(self.parts, first, asked.seam_group)
            words += _file("--seam-weights", stem + ".weights", rows, "%d %.9g")
        if self._held:
            rows = [_pin_rows(p, n) for p, n in zip(self.parts, first, strict=True)]
            words += _file("--pin", stem + ".pins", np.concatenate(rows), "%d %.9g %.9g")
        return words

    def take(self, report):
        """Write the result into Blender; returns its line, or the job that completes this one.

        Raises Failure before any change.
        """
        refuse_lost(self.parts)
        uv = read_uv(self._output, self.parts, self._polygons)
        if self._held:
            free = [_without_pins(p, new) for p, new in zip(self.parts, uv, strict=True)]
            if any(polygons.any() for polygons in free):
                return Rest(self, uv, free, report)
        return self.put(uv, report)

    def put(self, uv, report, notes=()):
        """Write uv, an array (l, 2) for each part, into Blender; returns the line about them."""
        for part, new in zip(self.parts, uv, strict=True):
            if part.chosen.any():
                part.put(new, self.asked.replace, self.asked.mark_seams)
        if "distortion" not in report:
            return f"{self.names}: done"
        charts = (report.get("kept") or report)["charts"]
        smaller = [n for n in [*report.get("notes", ()), *notes] if "for want of room" in n]
        said = f"{self.names}: {charts} charts, distortion {report['distortion']:.3f}"
        return ", ".join([said, *smaller])


class Rest:
    """The second run of a job with held points: charts without points are packed around the others.

    uv: result of the first run, (l, 2) for each part. free: (p,) bool for each part, the polygons to move.
    report: of the first run.
    """

    def __init__(self, job, uv, free, report):
        self.parts, self.names = job.parts, job.names
        self._job, self._uv, self._free, self._report = job, uv, free, report
        self._polygons = [np.ones(len(p.total), bool) for p in self.parts]

    def words(self, stem):
        """Write the whole meshes with their new uv; returns the words after the program's name."""
        self._output = stem + "_rest_uv.obj"
        write_obj(stem + "_rest.obj", self.parts, uv=self._uv, polygons=self._polygons)
        stay = np.flatnonzero(~np.concatenate(self._free))
        words = ["pack", stem + "_rest.obj", "-o", self._output, "--json"]
        words += _file("--lock", stem + "_rest.faces", stay, "%d")
        return words + words_of(self._job.asked, "packing", "room")

    def take(self, report):
        """Write the result into Blender; returns its line. Raises Failure before any change."""
        refuse_lost(self.parts)
        uv = read_uv(self._output, self.parts, self._polygons)
        return self._job.put(uv, self._report, report.get("notes", ()))


def _hinted(part):
    """uv (l, 2) that differ between the sectors of chosen polygons; the program reads only the differences."""
    label = part.sectors()
    return np.where(part.corners[:, None], np.c_[label % 4096, label // 4096] / 4096, part.uv)


def _without_pins(part, uv):
    """(p,) bool: chosen polygons of the islands of uv (l, 2) in which no corner is pinned."""
    island = part.islands(uv)
    out = np.zeros(len(part.total), bool)
    out[part.polygon[part.corners & ~np.isin(island, island[part.pinned & part.corners])]] = True
    return out


def words_of(asked, *kinds):
    """Options of the program as the properties of the operator ask for them, by their kinds.

    sorting, straight and density lay out a whole page; room: of charts beside others.
    """
    group = {"NONE": None, "MATERIAL": "material", "OBJECT": "node"}[asked.group_by]
    stack = None if asked.stack == "OFF" else asked.stack.lower()
    sharp = f"{np.degrees(asked.sharp):.9g}" if asked.sharp else None
    known = {
        "packing": {
            "--resolution": asked.resolution,
            "--padding": asked.padding,
            "--effort": {"DRAFT": "0", "NORMAL": "1", "HIGH": "4"}[asked.effort],
        },
        "room": {"--keep-page": asked.keep_page},
        "sorting": {
            f"--{'pages' if asked.group_pages else 'group'}-by": group,
            "--stack": stack,
            "--stack-offset": bool(stack and asked.stack_offset),
            "--orient": "up" if asked.upright else None,
            "--up": "z" if asked.upright else None,
        },
        "straight": {
            "--straighten": asked.straighten.lower() if asked.straighten != "AUTO" else None
        },
        "density": {"--density": asked.densities or None},
        "charts": {
            "--max-distortion": f"{asked.max_distortion:.9g}",
            "--hide-seams": f"{asked.hide_seams:.9g}",
            "--max-charts": asked.max_charts or None,
            "--sharp": sharp,
            "--symmetry": asked.symmetry.lower() if asked.symmetry != "NONE" else None,
        },
    }
    words = []
    for flag, value in ((f, v) for kind in kinds for f, v in known[kind].items()):
        if value is not None and value is not False:
            words += [flag] if value is True else [flag, str(value)]
    return words


def _file(option, path, rows, form):
    """An option with a file of rows of numbers; nothing where there are none."""
    if not len(rows):
        return []
    np.savetxt(path, rows, fmt=form)
    return [option, path]


def _marked_pairs(part, first):
    """(s, 2) vertices in the file of the marked edges of chosen polygons."""
    return numbers(part.mesh.edges, "vertices", 2)[part.near() & part.marks()] + first


def _pin_rows(part, first):
    """(k, 3) vertex in the file, u, v: each pinned vertex of chosen polygons once."""
    at = np.flatnonzero(part.pinned & part.corners)
    vertex, one = np.unique(part.vertex[at], return_index=True)
    return np.c_[vertex + first, part.uv[at[one]]]


def _weight_rows(parts, first, group):
    """(k, 2) vertex in the file and what a seam near it costs: 1 / (1 − p) where p is painted."""
    painted = [p.painted(group) for p in parts]
    if all(weight is None for weight in painted):
        raise Failure(f"no vertex group is called {group}: correct the name under Keep seams away")
    rows = []
    for weight, n in zip(painted, first, strict=True):
        if weight is not None and (at := np.flatnonzero(weight > 0)).size:
            with np.errstate(divide="ignore"):
                rows.append(np.c_[at + n, 1 / (1 - np.minimum(weight[at], 1))])
    return np.concatenate(rows) if rows else np.zeros((0, 2))


def refuse_lost(parts):
    """Raise Failure if a mesh was changed or deleted."""
    gone = []
    for part in parts:
        try:
            gone += [part.name] if part.changed() else []
        except ReferenceError:
            gone.append(part.name)
    if gone:
        which = "it" if len(parts) == 1 else " and ".join(gone)
        raise Failure(f"{which} was changed or deleted while circparam worked: run it again")
