"""How far layouts are relaxed in the search for charts: one table for all its steps."""

from dataclasses import replace

import numpy as np

from circparam.solvers.newton import RelaxOptions

# candidates, of which most are refused: their order does not change below a thousandth of the energy
TRIAL = RelaxOptions(tolerance=1e-3)
# first charts: those a hundredth above an isometry need no further step to be judged
ROUGH = replace(TRIAL, bound=1.01)
# charts that are kept: the bound has four digits
FINAL = RelaxOptions(tolerance=1e-4)
LOCAL = 8  # iterations of a step where only what is near a few faces moves
# of an excess that is allowed, of the distortion, the stretch or the share of what is stretched: what is aimed
# for, since what is aimed at is missed by a little. Trials end there: fewer steps, and shorter seams, 0.978
# [0.953, 0.998] of the cost on 41 meshes
AIMED = 0.8
# distortion that every chart without flips keeps to; sums and products of it stay finite
ANY_BOUND = float(np.sqrt(np.finfo(float).max))
UNROLLED = 1 + 1e-6  # energy at which charts of hard surfaces count as unrolled
