"""The symmetric Dirichlet energy, its gradient and its projected Hessian, face by face.

E(J) = (σ1² + σ2² + σ1⁻² + σ2⁻²) / 4 for the Jacobian J of a face, so that an isometry has 1. All arrays hold
the face index last (components first): every line below runs over all faces at once in contiguous memory.
Eigensystem after Smith, Goes and Kim (2019), "Analytic eigensystems for isotropic distortion energies". Proxy
weights after Rabinovich, Poranne, Panozzo and Sorkine-Hornung (2017), "Scalable locally injective mappings"
(SLIM).
"""

import numpy as np

from circparam.core.arrays import FloatArray

# energy from which a face counts as collapsed: its gradient may leave the range of floats
COLLAPSED_ENERGY = 1e100


def jacobians(gradients: FloatArray, corners: FloatArray) -> FloatArray:
    """J (2, 2, m), surface to plane: J[d, c] = Σ_k corners[d, k] · gradients[c, k].

    gradients: (2, 3, m) hat-function gradients. corners: (2, 3, m) uv of the corners. Differences are taken
    first, so that a face far from the origin loses no digits.
    """
    a = corners[:, 1] - corners[:, 0]
    b = corners[:, 2] - corners[:, 0]
    return a[:, None] * gradients[None, :, 1] + b[:, None] * gradients[None, :, 2]


def determinants(jacobian: FloatArray) -> FloatArray:
    """(m,) determinant of each J: negative where the face is flipped."""
    return jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0]


def _square(jacobian: FloatArray) -> FloatArray:
    """(m,) squared Frobenius norm of each J."""
    (a, b), (c, d) = jacobian
    return a * a + b * b + c * c + d * d


def energy(jacobian: FloatArray, blend: float = 0.0) -> FloatArray:
    """(m,) energy of each face, 1 for an isometry, infinite if the face is flipped or collapsed.

    blend: share of the conformal energy (σ1/σ2 + σ2/σ1) / 2 (Hormann and Greiner 2000) in the sum.
    """
    det = determinants(jacobian)
    frobenius = _square(jacobian)
    with np.errstate(all="ignore"):
        value = frobenius * (1 + 1 / (det * det)) / 4
        if blend:
            value = (1 - blend) * value + blend * frobenius / (2 * det)
    return np.where((det > 0) & (value < COLLAPSED_ENERGY), value, np.inf)


def gradient(jacobian: FloatArray, blend: float = 0.0) -> FloatArray:
    """(2, 2, m) dE/dJ for faces with a positive determinant."""
    det = determinants(jacobian)
    frobenius = _square(jacobian)
    (a, b), (c, d) = jacobian
    cofactor = np.empty_like(jacobian)
    cofactor[0, 0], cofactor[0, 1], cofactor[1, 0], cofactor[1, 1] = d, -c, -b, a
    result: FloatArray = (jacobian * (1 + 1 / (det * det)) - frobenius / det**3 * cofactor) / 2
    if blend:
        conformal = jacobian / det - frobenius / (2 * det * det) * cofactor
        result = (1 - blend) * result + blend * conformal
    return result


def _rotation_parts(jacobian: FloatArray) -> tuple[FloatArray, ...]:
    """σ1, σ2 and the cosines and sines of the rotation part and of the reflection part of J."""
    (a, b), (c, d) = jacobian
    e, f, g, h = (a + d) / 2, (a - d) / 2, (c + b) / 2, (c - b) / 2
    q, r = np.hypot(e, h), np.hypot(f, g)
    s1 = q + r
    s2 = np.maximum(determinants(jacobian) / s1, 1e-12 * s1)
    with np.errstate(all="ignore"):
        cx, sx = np.where(q > 0, e / q, 1.0), np.where(q > 0, h / q, 0.0)
        cy, sy = np.where(r > 0, f / r, 1.0), np.where(r > 0, g / r, 0.0)
    return s1, s2, cx, sx, cy, sy


def newton_modes(jacobian: FloatArray, blend: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs of the Hessian of E with respect to J, negative eigenvalues set to zero.

    Returns (values (4, m), modes (4, 2, 2, m)): two of scaling along σ1 and σ2, the twist (rotation), the flip.
    """
    s1, s2, cx, sx, cy, sy = _rotation_parts(jacobian)
    g1, g2 = 2 * s1 - 2 / s1**3, 2 * s2 - 2 / s2**3
    values, modes = np.empty((4, len(s1))), np.empty((4, 2, 2, len(s1)))
    values[0] = 2 + 6 / s1**4
    values[1] = 2 + 6 / s2**4
    values[2] = np.maximum((g1 + g2) / (s1 + s2), 0)
    values[3] = 2 + 2 * (s1 * s1 + s1 * s2 + s2 * s2) / (s1 * s2) ** 3
    # the rotation (cx, −sx; sx, cx) and the reflection (cy, sy; sy, −cy): half their sum, half their difference
    (a, b), (c, d) = modes[0]
    a[:], b[:], c[:], d[:] = cx + cy, sy - sx, sx + sy, cx - cy
    (a, b), (c, d) = modes[1]
    a[:], b[:], c[:], d[:] = cx - cy, -sx - sy, sx - sy, cx + cy
    modes[:2] /= 2
    # the same turned by a right angle, over the root of 2
    (a, b), (c, d) = modes[2]
    a[:], b[:], c[:], d[:] = -sx, -cx, cx, -sx
    (a, b), (c, d) = modes[3]
    a[:], b[:], c[:], d[:] = -sy, cy, cy, sy
    modes[2:] *= np.sqrt(0.5)
    values /= 4
    if blend:
        _blend_conformal(values, modes, s1, s2, blend)
    return values, modes


def _blend_conformal(
    values: FloatArray, modes: FloatArray, s1: FloatArray, s2: FloatArray, blend: float
) -> None:
    """Mix the eigensystem of (σ1/σ2 + σ2/σ1) / 2 in, in place; its scalings are coupled, so they are turned."""
    values *= 1 - blend
    product = s1 * s2
    values[3] += blend * (1 / product + (s1 * s1 + product + s2 * s2) / product**2) / 2
    # its twist is −(σ1 − σ2)² / (2 σ1² σ2²): never positive, so it only lowers that of the Dirichlet energy
    values[2] = np.maximum(values[2] - blend * (s1 - s2) ** 2 / (2 * product**2), 0)
    p = values[0] + blend * s2 / s1**3
    r = values[1] + blend * s1 / s2**3
    q = -blend * (1 / s1**2 + 1 / s2**2) / 2
    middle, half = (p + r) / 2, np.hypot((p - r) / 2, q)
    values[0], values[1] = np.maximum(middle + half, 0), np.maximum(middle - half, 0)
    angle = np.arctan2(q, (p - r) / 2) / 2
    c, s = np.cos(angle), np.sin(angle)
    modes[0], modes[1] = c * modes[0] + s * modes[1], c * modes[1] - s * modes[0]


def proxy_modes(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The SLIM proxy in the same form: squared weight ω(σ) = (σ + 1)(σ² + 1)/σ³ along each singular direction.

    Its quadratic has the gradient of E at J; far from the minimum it leads better than the Hessian.
    """
    s1, s2, cx, sx, cy, sy = _rotation_parts(jacobian)
    values = np.stack([2 * (s + 1) * (s * s + 1) / s**3 for s in (s1, s2)])
    # U1 and U2 at half the angle between the rotation and the reflection part: only U Uᵀ is needed
    c, s = cx * cy - sx * sy, sx * cy + cx * sy  # cos and sin of twice the angle of U1
    u1 = np.stack(
        [np.sqrt(np.maximum((1 + c) / 2, 0)), np.copysign(np.sqrt(np.maximum((1 - c) / 2, 0)), s)]
    )
    u2 = np.stack([-u1[1], u1[0]])
    zero = np.zeros_like(c)
    one = np.ones_like(c)
    # ‖W (J − R)‖² acts on the columns of J alike: modes U_k e_cᵀ
    modes = np.stack(
        [
            u[:, None] * np.stack([x, y])[None]
            for u in (u1, u2)
            for x, y in ((one, zero), (zero, one))
        ]
    )
    return np.repeat(values, 2, axis=0) / 4, modes


def edge_blocks(values: FloatArray, modes: FloatArray, gradients: FloatArray) -> FloatArray:
    """Off-diagonal 2 × 2 Hessian blocks of each face: (2, 2, 3, m) for its half-edges (k, k + 1).

    The diagonal blocks follow from translation invariance: each is minus the sum of its row.
    """
    q = modes[:, :, 0, None] * gradients[0] + modes[:, :, 1, None] * gradients[1]  # (4, 2, 3, m)
    weighted = q * values[:, None, None]
    ahead = q[:, :, [1, 2, 0]]
    out = np.empty((2, 2, *q.shape[2:]))
    for d in range(2):
        for e in range(2):
            out[d, e] = np.einsum("ikm,ikm->km", weighted[:, d], ahead[:, e])
    return out


def largest_step(corners: FloatArray, direction: FloatArray) -> FloatArray:
    """(m,) the first positive t at which corners + t · direction collapses a face (infinite if none).

    corners, direction: (2, 3, m). The signed area is the quadratic c + b t + a t². Its roots are computed in
    the form without cancellation (Smith and Schaefer 2015).
    """
    u1, u2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p1, p2 = direction[:, 1] - direction[:, 0], direction[:, 2] - direction[:, 0]
    c = u1[0] * u2[1] - u1[1] * u2[0]
    b = u1[0] * p2[1] - u1[1] * p2[0] + p1[0] * u2[1] - p1[1] * u2[0]
    a = p1[0] * p2[1] - p1[1] * p2[0]
    discriminant = b * b - 4 * a * c
    with np.errstate(all="ignore"):
        q = -(b + np.copysign(np.sqrt(np.maximum(discriminant, 0)), b)) / 2
        roots = np.stack([q / a, c / q])
        valid = (roots > 0) & np.isfinite(roots) & (discriminant >= 0)
        result: FloatArray = np.where(valid, roots, np.inf).min(0)
    return result
