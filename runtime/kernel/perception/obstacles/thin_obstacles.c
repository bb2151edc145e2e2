/* Twins of runtime/control/perception/obstacles/thin_obstacles.py: single returns, and those that come again. */

#include "arrays.h"
#include "constants.h"

/* find_thin_places(x, y, solid, ranges, dirty | None, first bearing, step, at x, at y, yaw)
 *   -> places in odom, lonely ones in base_link */
KERNEL(find_thin_places) {
    struct row x, y, solid, range, dirty = {NULL, 0, 0};
    double v[5];
    const beam apart = THIN_OBSTACLES_STANDS_OUT_BEAMS;
    if (!enough(count, 10, "find_thin_places") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid) || !as_row(given[3], NPY_DOUBLE, &range) ||
        (given[4] != Py_None && !as_row(given[4], NPY_BOOL, &dirty)) || !as_numbers(given + 5, 5, v))
        return NULL;
    if (x.count != range.count || y.count != range.count || solid.count != range.count ||
        (dirty.data && dirty.count != range.count)) {
        PyErr_SetString(PyExc_ValueError, "thin_places: arrays of different lengths");
        return NULL;
    }
    double middle = rint(-v[0] / v[1]), half = rint(THIN_OBSTACLES_AHEAD_RAD / fabs(v[1]));
    if (!isfinite(middle) || !isfinite(half))
        return PyErr_Format(PyExc_ValueError, "thin_places: no angle from beam to beam");
    place turned = CMPLX(cos(v[4]), sin(v[4])), at = CMPLX(v[2], v[3]);
    beam from = (beam)within(middle - half, (double)apart, (double)range.count);
    beam to = (beam)within(middle + half + 1, 0.0, (double)(range.count - apart));
    place *found = malloc(2 * sizeof(place) * (size_t)(to > from ? to - from : 1));
    if (!found)
        return PyErr_NoMemory();
    place *lonely = found + (to > from ? to - from : 1);
    beam few = 0, alone = 0;
    for (beam i = from; i < to; i++) {
        double here = NUMBER(range, i);
        if (here < THIN_OBSTACLES_WITHIN_M && here > THIN_OBSTACLES_FROM_M && !(NUMBER(range, i + apart) - here < THIN_OBSTACLES_STANDS_OUT_M) &&
            !(NUMBER(range, i - apart) - here < THIN_OBSTACLES_STANDS_OUT_M) && !(dirty.data && FLAG(dirty, i))) {
            place seen = CMPLX(NUMBER(x, i), NUMBER(y, i));
            found[few++] = times(seen, turned) + at;
            if (!FLAG(solid, i))
                lonely[alone++] = seen;
        }
    }
    PyObject *all = copied(NPY_CDOUBLE, few, found), *some = copied(NPY_CDOUBLE, alone, lonely);
    free(found);
    if (all && some)
        return Py_BuildValue("(NN)", all, some);
    Py_XDECREF(all);
    Py_XDECREF(some);
    return NULL;
}

/* find_returning(seen, before, at x, at y, yaw) -> places | None */
KERNEL(find_returning) {
    struct row seen, old[8];
    double v[3];
    if (!enough(count, 5, "find_returning") || !as_row(given[0], NPY_CDOUBLE, &seen) || !as_numbers(given + 2, 3, v))
        return NULL;
    if (!PyTuple_Check(given[1]) || PyTuple_GET_SIZE(given[1]) > 8) {
        PyErr_SetString(PyExc_TypeError, "returned wants a tuple of at most 8 arrays");
        return NULL;
    }
    int scans = (int)PyTuple_GET_SIZE(given[1]);
    beam most_places = seen.count;
    for (int k = 0; k < scans; k++) {
        if (!as_row(PyTuple_GET_ITEM(given[1], k), NPY_CDOUBLE, &old[k]))
            return NULL;
        most_places += old[k].count;
    }
    place turned = CMPLX(cos(v[2]), sin(v[2])), at = CMPLX(v[0], v[1]);
    place *found = malloc(sizeof(place) * (size_t)(most_places + 1));
    npy_bool *kept = calloc((size_t)most_places + 1, 1);
    if (!found || !kept) {
        free(found);
        free(kept);
        return PyErr_NoMemory();
    }
    beam there = 0, places = 0;
    for (beam i = 0; i < seen.count; i++) {
        place here = PLACE(seen, i), odom = times(here, turned) + at;
        place along = conj(here) / (cabs(here) * turned);
        npy_bool *of_scan = kept;
        int again = 0;
        for (int pass = 0; pass < 2; pass++) { /* count the scans first, then keep what they saw */
            of_scan = kept;
            for (int k = 0; k < scans; k++) {
                int same = 0;
                for (beam j = 0; j < old[k].count; j++) {
                    place off = times(PLACE(old[k], j) - odom, along);
                    if (fabs(creal(off)) < THIN_OBSTACLES_SAME_RANGE_M && fabs(cimag(off)) < THIN_OBSTACLES_SAME_ASIDE_M) {
                        same = 1;
                        if (pass)
                            of_scan[j] = 1;
                    }
                }
                again += same && !pass;
                of_scan += old[k].count;
            }
            if (again < THIN_OBSTACLES_SCANS - 2)
                break;
        }
        if (again >= THIN_OBSTACLES_SCANS - 2) {
            there++;
            found[places++] = here;
        }
    }
    if (there) {
        npy_bool *of_scan = kept;
        for (int k = 0; k < scans; k++) {
            for (beam j = 0; j < old[k].count; j++)
                if (of_scan[j])
                    found[places++] = times(PLACE(old[k], j) - at, conj(turned));
            of_scan += old[k].count;
        }
    }
    PyObject *answer = there ? copied(NPY_CDOUBLE, places, found) : Py_NewRef(Py_None);
    free(found);
    free(kept);
    return answer;
}
