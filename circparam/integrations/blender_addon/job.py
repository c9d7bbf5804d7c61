"""What is asked of the program for some parts in one page, and what becomes of its answer."""

import numpy as np

from .exchange import numbers, read_uv, write_obj
from .failure import Failure
from .room import find_room, turned


class Job:
    """Some parts that share a page, from the file that the program reads to uv in Blender.

    asked: the properties of the operator. Where not all polygons are chosen, the others keep their uv to the
    bit, and the new charts go where those leave room.
    """

    def __init__(self, parts, asked):
        self.parts, self.asked = parts, asked
        self.names = ", ".join(p.name for p in parts)

    def words(self, stem):
        """Write the files of the job; returns the words after the program's name."""
        asked, self._output = self.asked, stem + "_uv.obj"
        packs = asked.action == "PACK"
        hints = not packs and asked.seams == "HINT" and any(p.marks().any() for p in self.parts)
        uv = None
        if packs:
            uv = [p.uv for p in self.parts]
        elif hints:  # only where uv differ is read of them
            label = [p.sectors() for p in self.parts]
            uv = [np.c_[k % 4096, k // 4096] / 4096 for k in label]
        axis = 1 if asked.symmetry == "Z" else 2
        first = write_obj(stem + ".obj", self.parts, axis, uv)
        command = "pack" if packs else "unwrap"
        words = [command, stem + ".obj", "-o", self._output, "--json"]
        self.held = (
            not packs
            and asked.pins == "POINTS"
            and any(p.pinned[p.corners].any() for p in self.parts)
        )
        sorting = sorting_words(asked)
        if sorting and (self.held or not all(p.whole for p in self.parts)):
            raise Failure(
                f"{sorting[0]} places all charts anew: select all faces and hold no points, or switch it off"
            )
        words += sorting
        words += ["--density", asked.densities] if asked.densities else []
        if not self.held:
            words += packing_words(asked)
        if packs:
            return words
        words += chart_words(asked)
        if hints:
            words.append("--keep-uv-seams")
        if asked.seams == "MUST":
            pairs = [_marked_pairs(p, n) for p, n in zip(self.parts, first, strict=True)]
            words += _file("--seams", stem + ".seams", np.concatenate(pairs), "%d %d")
        if asked.seam_group:
            rows = _weight_rows(self.parts, first, asked.seam_group)
            words += _file("--seam-weights", stem + ".weights", rows, "%d %.9g")
        if self.held:
            rows = [_pin_rows(p, n) for p, n in zip(self.parts, first, strict=True)]
            words += _file("--pin", stem + ".pins", np.concatenate(rows), "%d %.9g %.9g")
        return words

    def take(self, report):
        """Put the answer into Blender; returns its line. Raises Failure, and then nothing has changed."""
        if gone := [p.name for p in self.parts if _lost(p)]:
            which = "it" if len(self.parts) == 1 else " and ".join(gone)
            raise Failure(f"{which} was changed or deleted while circparam worked: run it again")
        uv = read_uv(self._output, self.parts)
        smaller = ""
        if self.held or not all(p.whole for p in self.parts):
            uv, share = self._placed(uv)
            if share < 0.999:
                smaller = f", at {100 * share:.0f} % of the density of the others for want of room"
        for part, new in zip(self.parts, uv, strict=True):
            part.put(new, self.asked.replace, self.asked.mark_seams)
        if "distortion" not in report:
            return f"{self.names}: done"
        return f"{self.names}: {report['charts']} charts, distortion {report['distortion']:.3f}{smaller}"

    def _placed(self, uv):
        """The charts where nothing else lies: ([(l, 2)], their size as a share of the one wanted)."""
        wanted, others = 1.0, density(self.parts, [p.uv for p in self.parts], chosen=False)
        if self.asked.action == "PACK":
            uv = [p.uv for p in self.parts]  # at the size that they have
        elif others and not self.held and not self.asked.density:
            wanted = others / density(self.parts, uv, chosen=True)
        used = [p.triangles(p.uv, ~p.corners) for p in self.parts if others]
        charts, owners = [], []
        for number, (part, new) in enumerate(zip(self.parts, uv, strict=True)):
            island = np.where(part.corners, part.islands(new), -1)
            for label in np.unique(island[island >= 0]):
                mask = island == label
                if self.held and part.pinned[mask].any():
                    used.append(part.triangles(new, mask))
                else:
                    charts.append(part.triangles(new, mask).astype(np.float64))
                    owners.append((number, mask))
        if not sum(map(len, used)) or not charts:
            return uv, 1.0
        padding = self.asked.padding / self.asked.resolution
        exact = bool(self.asked.density) and not self.held
        places = find_room(charts, np.concatenate(used), wanted, padding, exact)
        if places is None:
            raise Failure(
                "the page has no room beside the charts that stay: free some, or pack all"
            )
        out = [u.astype(np.float64) for u in uv]
        for (number, mask), (scale, shift, turns) in zip(owners, places, strict=True):
            out[number][mask] = turned(out[number][mask], turns) * scale + shift
        return [u.astype(np.float32) for u in out], places[0][0] / wanted


def density(parts, uv, chosen):
    """Uv units a unit of length over the chosen polygons of all parts, or over the others; 0 without uv."""
    plane = space = 0.0
    for part, at in zip(parts, uv, strict=True):
        corners = part.corners == chosen
        a, b, c = part.triangles(at.astype(np.float64), corners).swapaxes(0, 1)
        plane += abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
        points = part.points.astype(np.float64) @ part.stretch.T
        a, b, c = part.triangles(points[part.vertex], corners).swapaxes(0, 1)
        space += np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return float(np.sqrt(plane / space)) if space > 0 else 0.0


def packing_words(asked):
    """Options of packing."""
    words = ["--resolution", str(asked.resolution), "--padding", str(asked.padding)]
    words += ["--effort", {"DRAFT": "0", "NORMAL": "1", "HIGH": "4"}[asked.effort]]
    return words + (["--texel-density", f"{asked.density:.9g}"] if asked.density else [])


def sorting_words(asked):
    """Options that place all charts of a page: groups, upright and straight charts, stacks."""
    kind = {"NONE": "", "MATERIAL": "material", "OBJECT": "node"}[asked.group_by]
    words = [f"--{'pages' if asked.group_pages else 'group'}-by", kind] if kind else []
    words += ["--stack", asked.stack.lower()] if asked.stack != "OFF" else []
    words += ["--stack-offset"] if asked.stack != "OFF" and asked.stack_offset else []
    words += ["--orient", "up", "--up", "z"] if asked.upright else []
    return words + (
        ["--straighten", asked.straighten.lower()] if asked.straighten != "AUTO" else []
    )


def chart_words(asked):
    """Options of charts and seams."""
    words = ["--max-distortion", f"{asked.max_distortion:.9g}"]
    words += ["--hide-seams", f"{asked.hide_seams:.9g}"]
    words += ["--max-charts", str(asked.max_charts)] if asked.max_charts else []
    words += ["--sharp", f"{np.degrees(asked.sharp):.9g}"] if asked.sharp else []
    return words + (["--symmetry", asked.symmetry.lower()] if asked.symmetry != "NONE" else [])


def _file(option, path, rows, form):
    """An option with a file of rows of numbers; nothing where there are none."""
    if not len(rows):
        return []
    np.savetxt(path, rows, fmt=form)
    return [option, path]


def _marked_pairs(part, first):
    """(s, 2) vertices in the file of the marked edges of chosen polygons."""
    near = np.zeros(len(part.mesh.edges), bool)
    near[part.edge[part.corners]] = True
    return numbers(part.mesh.edges, "vertices", 2)[near & part.marks()] + first


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


def _lost(part):
    """Whether the mesh of a part is another one now, or gone."""
    try:
        return part.changed()
    except ReferenceError:
        return True
