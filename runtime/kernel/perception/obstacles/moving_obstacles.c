/* Twin of runtime/control/perception/obstacles/moving_obstacles.py: small clusters before a background. */

#include "arrays.h"
#include "constants.h"

/* Whether the first solid of the next beams in this direction is clearly farther away. */
static int behind(const struct row *solid, const struct row *range, beam first, beam step, double range_m) {
    for (beam k = 0, i = first; k < MOVING_OBSTACLES_BACKGROUND_BEAMS; k++, i += step) {
        if (i < 0 || i >= solid->count)
            return 0;
        if (FLAG(*solid, i))
            return NUMBER(*range, i) > range_m + MOVING_OBSTACLES_JUMP_M;
    }
    return 1;
}

/* find_small_clusters(solid, ranges, step_rad) -> [(first, last), ...] */
KERNEL(find_small_clusters) {
    struct row solid, range;
    double step_rad;
    if (!enough(count, 3, "find_small_clusters") || !as_row(given[0], NPY_BOOL, &solid) ||
        !as_row(given[1], NPY_DOUBLE, &range) || !as_numbers(given + 2, 1, &step_rad))
        return NULL;
    if (solid.count != range.count) {
        PyErr_SetString(PyExc_ValueError, "find_small_clusters: arrays of different lengths");
        return NULL;
    }
    PyObject *things = PyList_New(0);
    beam right = -1, last = -1, points = 0;
    for (beam i = 0; things && i <= solid.count; i++) {
        int ends = i == solid.count;
        if (!ends && !(FLAG(solid, i) && NUMBER(range, i) < MOVING_OBSTACLES_WITHIN_M))
            continue;
        int cut = last >= 0 && (ends || i - last > MOVING_OBSTACLES_GAP_BEAMS ||
                                fabs(NUMBER(range, i) - NUMBER(range, last)) > MOVING_OBSTACLES_JUMP_M);
        if (cut && points >= MOVING_OBSTACLES_MIN_BEAMS &&
            (double)(last - right) * step_rad * NUMBER(range, right) <= MOVING_OBSTACLES_MAX_WIDTH_M &&
            behind(&solid, &range, right - 1, -1, NUMBER(range, right)) &&
            behind(&solid, &range, last + 1, 1, NUMBER(range, last))) {
            PyObject *thing = Py_BuildValue("(nn)", right, last);
            if (!thing || PyList_Append(things, thing) < 0)
                Py_CLEAR(things);
            Py_XDECREF(thing);
        }
        if (cut || last < 0) {
            right = i;
            points = 0;
        }
        points++;
        last = i;
    }
    return things;
}
