"""Seams and the first layout; where the numbers of a mesh are beyond a method, a start for the cascade."""

from dataclasses import replace

import numpy as np

from circparam.core import clock
from circparam.core.monitor import Monitor
from circparam.errors import NoResultError, OutOfTimeError, TopologyError
from circparam.mesh.atlas import Atlas
from circparam.mesh.frame import frame_of
from circparam.mesh.surface import Surface
from circparam.methods import METHODS
from circparam.pipeline.configure import method_options
from circparam.pipeline.density import check_whole
from circparam.pipeline.fallback import FAULTY_DISTORTION, Cascade, CascadeRules
from circparam.pipeline.job import Job
from circparam.pipeline.options import DEFAULT_BOUND, Options
from circparam.pipeline.pinned import pins_of
from circparam.seams import SEAMS
from circparam.seams.constraints import constrain, seam_prices
from circparam.seams.options import SeamOptions, Seams

CHARTS_COST = 10.0  # seconds that charts take at least over those of the repair: 20 on many meshes
AREA_ROUNDING_SHARE = 1e-6  # share by which rounding in another frame may change the area of a face
# errors of numerical methods on meshes beyond double precision
NUMERICAL = (NoResultError, np.linalg.LinAlgError, ArithmeticError)


def find_seams(job: Job, monitor: Monitor) -> Seams:
    """The seams; where finding charts fails on numbers or time, those demanded: the cascade splits further."""
    asked = job.seams_asked
    free = job.options.cut == "charts"
    try:
        with clock.bounded(monitor.last if free else None):
            # time is up, and the reserve is too small for any charts
            left = clock.left()
            least = CHARTS_COST * monitor.seconds.get("repair", 0.0)
            if left is not None and left < least and monitor.expired:
                raise OutOfTimeError("out of time before the first step: give a longer --timeout")
            return seams_in_frame(job.surface, asked, job.options.cut, monitor)
    except (*NUMERICAL, OutOfTimeError) as error:
        if not free:
            raise
        monitor.late |= isinstance(error, OutOfTimeError)
        _, forced, notes = constrain(job.surface, asked)
        how = "projecting" if isinstance(error, OutOfTimeError) else "halving"
        why = f"charts were made by {how} ({str(error).partition(':')[0]})"
        # corners without a place: every chart is faulty
        return Seams(forced, np.full((len(job.surface.faces), 3, 2), np.nan), [*notes, why])


def seams_in_frame(surface: Surface, asked: SeamOptions, cut: str, monitor: Monitor) -> Seams:
    """Seams found in the frame of the surface, where the pose and the unit of a file change nothing.

    The axes of a symmetry are those of the file.
    """
    if asked.symmetry is not None:
        return SEAMS[cut].function(surface, asked, monitor)
    frame = frame_of(surface.points, surface.faces)
    own = replace(surface, points=frame.inside(surface.points))
    # faces that are tiny beside their surface may keep their shape near the origin of the file alone
    areas = own.areas * frame.unit**2
    if not np.allclose(areas, surface.areas, rtol=AREA_ROUNDING_SHARE, atol=0.0):
        return SEAMS[cut].function(surface, asked, monitor)
    seams = SEAMS[cut].function(own, asked, monitor)
    return seams if seams.uv is None else replace(seams, uv=seams.uv * frame.unit)


def first_layout(job: Job, seams: Seams, monitor: Monitor) -> Cascade:
    """The layout of the method, or the layout of the seams if both agree.

    Raises OptionError for pins that do not fit.
    """
    options, surface = job.options, surface_of_layout(job.surface, job.seams_asked)
    blank = Cascade(Atlas(surface, seams.cut), rules(options), notes=tuple(seams.notes))
    plain = options.method == "isometric" and not (options.blend or options.pins is not None)
    if options.cut == "none":
        check_whole(blank.open()[0], surface, job.document.source.name)
    if plain and seams.uv is not None:
        return replace(blank, atlas=with_straight(Atlas(surface, seams.cut, seams.uv), options))
    method = blank.rules.method
    try:
        with clock.bounded(monitor.last if options.cut == "charts" else None):
            cut_mesh, _ = blank.open()
            if options.pins is not None:
                method = replace(method, pins=pins_of(job, cut_mesh, options.pins))
            layout = METHODS[options.method].function(cut_mesh, method, monitor)
        atlas = Atlas(surface, seams.cut, layout.uv[cut_mesh.faces])
        after = replace(blank, atlas=atlas, stopped=layout.stopped, iterations=layout.iterations)
        return after.noted(*layout.notes)
    except (*NUMERICAL, TopologyError, OutOfTimeError) as error:
        if options.cut != "charts":
            raise
        monitor.late |= isinstance(error, OutOfTimeError)
        atlas = Atlas(surface, seams.cut, np.full((len(surface.faces), 3, 2), np.nan))
        return replace(blank, atlas=atlas).repaired(
            f"--method {options.method} failed at first ({error})"
        )


def surface_of_layout(surface: Surface, asked: SeamOptions) -> Surface:
    """The surface that layouts are compared with, where seams for the page have the prices of the user."""
    dense, price = surface.at_density(), seam_prices(surface, asked)
    return dense if price is None else replace(dense, price=price, weighted=True)


def with_straight(atlas: Atlas, options: Options) -> Atlas:
    """The atlas with developable charts unrolled and grids of quads as rectangles, unless this is off."""
    from circparam.pipeline.developable import gridded, unrolled

    if options.straighten == "off":
        return atlas
    bound = DEFAULT_BOUND if options.bound is None else options.bound
    return gridded(unrolled(atlas), bound, options.max_stretch, options.straighten == "all")


def rules(options: Options) -> CascadeRules:
    """Rules of the fallback cascade for these options."""
    convex = "convex-boundary" in METHODS[options.method].tags
    return CascadeRules(
        may_split=options.cut == "charts",
        remap=options.cut == "charts" or not convex,
        bound=FAULTY_DISTORTION if options.reachable_bound is None else options.reachable_bound,
        method=method_options(options),
    )
