"""Layouts as others make them, judged by ``check --uv`` and by integers: two-sided sheets, far pages, no uv.

A sheet of triangles with fronts and perhaps backs, whose uv are whole numbers of ``STEP``. Fronts have even
u, backs odd ones unless they lie on their fronts, so no front borders on a back by accident. What is expected
is counted face by face and pair by pair, in integers.
"""

from itertools import combinations

import numpy as np
from hypothesis import strategies as st

STEP = 1 / 64  # exact in the text of a file
TURNS = tuple(np.array(m) for m in ([[2, 0], [0, 2]], [[0, 2], [-2, 0]], [[-2, 0], [0, 2]]))
NONE = 2**60  # stands for NaN among whole numbers


@st.composite
def layouts(draw: st.DrawFn) -> tuple[bytes, dict[str, object] | None]:
    """(an OBJ file, what ``check --uv`` has to say of it); None where no face has uv."""
    wide, high = draw(st.integers(1, 3)), draw(st.integers(1, 2))
    at = np.stack(np.meshgrid(range(wide + 1), range(high + 1)), 2).reshape(-1, 2)
    corner = (np.arange(high)[:, None] * (wide + 1) + np.arange(wide)).ravel()
    first = np.stack([corner, corner + 1, corner + wide + 2], 1)
    front = np.concatenate([first, np.stack([corner, corner + wide + 2, corner + wide + 1], 1)])
    chosen = draw(st.lists(st.sampled_from(range(len(front))), unique=True))
    back = front[np.array(chosen, int)]
    if draw(st.booleans()):
        back = back[:, ::-1]
    faces = np.concatenate([front, back])
    uv = np.concatenate([_side(draw, at, 0)[front], _side(draw, at, 1)[back]])
    for k in draw(st.lists(st.sampled_from(range(len(faces))), max_size=2, unique=True)):
        fate = draw(st.sampled_from(["torn", "torn", "nan", "none"]))
        if fate == "torn":
            uv[k] += [2 * draw(st.integers(-20, 20)), draw(st.integers(-20, 20))]
        else:
            uv[k, : 3 if fate == "none" else 1] = NONE
    for k, face in enumerate(chosen):
        if draw(st.integers(0, 3)) == 0:  # it lies on its front
            own = (faces[len(front) + k][:, None] == front[face]).argmax(1)
            uv[len(front) + k] = uv[face, own]
    return _obj(at, faces, uv), expected(faces, uv)


def _side(draw: st.DrawFn, at: np.ndarray, odd: int) -> np.ndarray:
    """(n, 2) uv of the points ``at`` (n, 2) of one side, in steps."""
    scale = draw(st.sampled_from([1, 1, 3, 200]))
    far = draw(st.sampled_from([0, 0, 0, 1, -1, 7, 10**6]))
    room = draw(st.sampled_from([5, 30]))  # sides often overlap in the small one
    place = np.array([2 * draw(st.integers(0, room)), draw(st.integers(0, 2 * room))])
    uv = at @ draw(st.sampled_from(TURNS)) * scale + place + [64 * far, 0]
    if draw(st.booleans()):
        uv[draw(st.integers(0, len(uv) - 1))] += [2 * draw(st.integers(-4, 4)) * scale, scale]
    return uv + np.array([odd, 0])


def _obj(at: np.ndarray, faces: np.ndarray, uv: np.ndarray) -> bytes:
    """The text of a file; corners of faces without any uv have no number of one."""
    lines = [f"v {x} {y} 0" for x, y in at.tolist()]
    rows = np.where(uv == NONE, np.nan, uv * STEP).reshape(-1, 2)
    lines += [f"vt {u!r} {v!r}" for u, v in rows.tolist()]
    for k, face in enumerate((faces + 1).tolist()):
        bare = (uv[k] == NONE).all()
        corners = [str(p) if bare else f"{p}/{3 * k + c}" for c, p in enumerate(face, 1)]
        lines.append("f " + " ".join(corners))
    return ("\n".join(lines) + "\n").encode()


def expected(faces: np.ndarray, uv: np.ndarray) -> dict[str, object] | None:
    """The figures of a layout: faces (m, 3), uv (m, 3, 2) in steps."""
    corners = [
        dict(zip(f, map(tuple, t), strict=True))
        for f, t in zip(faces.tolist(), uv.tolist(), strict=True)
    ]
    ok = (uv != NONE).all((1, 2))
    judged = [k for k in np.flatnonzero(ok) if corners[k] not in [corners[j] for j in range(k)]]
    if not judged:
        return None
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    sign = np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    flips = mirrored = outside = 0
    pages = set()
    for chart in _charts(judged, corners):
        turned = (sign[chart] < 0).sum() > (sign[chart] > 0).sum()
        flips += int((sign[chart] * (-1 if turned else 1) <= 0).sum())
        mirrored += int(turned)
        low, high = uv[chart].min((0, 1)), uv[chart].max((0, 1))
        page = max(int(low[0] + high[0]) // 128, 0)
        pages.add(page)
        edge = np.array([64 * page, 0])
        outside += int((low < edge).any() or (high > edge + 64).any())
    missing, shared = int((~ok).sum()), int(ok.sum()) - len(judged)
    meets = any(_meet(uv[i], uv[j]) for i, j in combinations(judged, 2))
    return {
        "missing": missing, "flips": flips, "mirrored": mirrored, "outside": outside,
        "pages": len(pages), "valid": not (missing or flips or mirrored or meets), "shared": shared,
    }  # fmt: skip


def _charts(judged: list[int], corners: list[dict[int, tuple[int, int]]]) -> list[list[int]]:
    """Faces that hang together over edges with the same uv on both sides."""
    label = {k: k for k in judged}
    for i, j in combinations(judged, 2):
        alike = [p for p in corners[i] if corners[j].get(p) == corners[i][p]]
        shared = set(corners[i]) & set(corners[j])
        if len(shared) == 2 and len(alike) == 2:
            one, other = label[i], label[j]
            label = {k: one if x == other else x for k, x in label.items()}
    return [[k for k in judged if label[k] == x] for x in sorted(set(label.values()))]


def _meet(s: np.ndarray, t: np.ndarray) -> bool:
    """Whether the insides of two triangles (3, 2) of whole numbers meet: no side of either separates them."""
    for one, other in ((s, t), (t, s)):
        for k in range(3):
            a, b, c = (one[(k + i) % 3] for i in range(3))

            def side(p: np.ndarray, a: np.ndarray = a, b: np.ndarray = b) -> np.ndarray:
                return (b - a)[0] * (p - a)[..., 1] - (b - a)[1] * (p - a)[..., 0]

            own = side(c)
            if own == 0 or (side(other) * np.sign(own) <= 0).all():
                return False
    return True
