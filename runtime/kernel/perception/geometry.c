/* Twins of runtime/control/perception/geometry.py: solid returns as places. */

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
