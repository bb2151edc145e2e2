/* Twins of runtime/control/perception/geometry.py: solid returns as places, and points beside a path. */

#include "arrays.h"
#include "constants.h"

/* solid_places(x, y, solid) -> places */
KERNEL(solid_places) {
    struct row x, y, solid;
    if (!enough(count, 3, "solid_places") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid))
        return NULL;
    if (x.count != solid.count || y.count != solid.count) {
        PyErr_SetString(PyExc_ValueError, "solid_places: arrays of different lengths");
        return NULL;
    }
    beam few = 0;
    for (beam i = 0; i < solid.count; i++)
        few += FLAG(solid, i) != 0;
    PyObject *answer = fresh(NPY_CDOUBLE, few);
    if (!answer)
        return NULL;
    place *to = DATA(place, answer);
    for (beam i = 0; i < solid.count; i++)
        if (FLAG(solid, i))
            *to++ = CMPLX(NUMBER(x, i), NUMBER(y, i));
    return answer;
}

/* any_nearer(solid, ranges, reach) -> bool */
KERNEL(any_nearer) {
    struct row solid, range;
    double reach_m;
    if (!enough(count, 3, "any_nearer") || !as_row(given[0], NPY_BOOL, &solid) ||
        !as_row(given[1], NPY_DOUBLE, &range) || !as_numbers(given + 2, 1, &reach_m))
        return NULL;
    for (beam i = 0; i < solid.count && i < range.count; i++)
        if (FLAG(solid, i) && NUMBER(range, i) < reach_m)
            Py_RETURN_TRUE;
    Py_RETURN_FALSE;
}

/* Distance of a point from a path, 0 beyond its end; NaN where the point or the path is no number. */
static double beside(place point, const struct row *path) {
    double nearest = INFINITY, share = 0.0;
    beam at = 0;
    for (beam i = 0; i + 1 < path->count; i++) {
        place there = point - PLACE(*path, i), chord = PLACE(*path, i + 1) - PLACE(*path, i);
        double x = creal(there), y = cimag(there), cx = creal(chord), cy = cimag(chord);
        share = (x * cx + y * cy) / most(cx * cx + cy * cy, 1e-12);
        double part = share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share, off = hypot(x - part * cx, y - part * cy);
        if (isnan(off))
            return off;
        if (off < nearest) {
            nearest = off;
            at = i;
        }
    }
    return at == path->count - 2 && share > 1.0 ? 0.0 : nearest;
}

/* beside_path_m(points, path) -> distances */
KERNEL(beside_path_m) {
    struct row points, path;
    if (!enough(count, 2, "beside_path_m") || !as_row(given[0], NPY_CDOUBLE, &points) ||
        !as_row(given[1], NPY_CDOUBLE, &path))
        return NULL;
    if (path.count < 2)
        return PyErr_Format(PyExc_ValueError, "beside_path_m: a path has at least two points");
    PyObject *answer = fresh(NPY_DOUBLE, points.count);
    for (beam i = 0; answer && i < points.count; i++)
        DATA(double, answer)[i] = beside(PLACE(points, i), &path);
    return answer;
}
