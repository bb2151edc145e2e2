/* Twins of runtime/control/perception/rear_places.py: places that are seen again, and where they are due. */

#include "arrays.h"
#include "constants.h"

/* As numpy's minimum: NaN stays. */
static double nearer(double a, double b) { return b < a || isnan(b) ? b : a; }

/* seen_again(ranges, beams, away, at_beam) -> which of the beams */
KERNEL(seen_again) {
    struct row range, beams, away, at;
    if (!enough(count, 4, "seen_again") || !as_row(given[0], NPY_DOUBLE, &range) || !as_row(given[1], NPY_INTP, &beams) ||
        !as_row(given[2], NPY_DOUBLE, &away) || !as_row(given[3], NPY_DOUBLE, &at))
        return NULL;
    if (away.count != at.count)
        return PyErr_Format(PyExc_ValueError, "seen_again: arrays of different lengths");
    double farthest_m = -INFINITY;
    for (beam k = 0; k < beams.count; k++) {
        if (INDEX(beams, k) < 0 || INDEX(beams, k) >= range.count)
            return PyErr_Format(PyExc_IndexError, "seen_again: no beam %zd", (Py_ssize_t)INDEX(beams, k));
        farthest_m = -nearer(-farthest_m, -NUMBER(range, INDEX(beams, k)));
    }
    farthest_m += REAR_PLACES_SAME_PLACE_M;
    PyObject *answer = fresh(NPY_BOOL, beams.count);
    npy_bool *again = calloc((size_t)range.count + 1, 1);
    if (!answer || !again) {
        Py_XDECREF(answer);
        free(again);
        return PyErr_NoMemory();
    }
    for (beam i = 0; i < at.count; i++) {
        double at_beam = NUMBER(at, i), away_m = NUMBER(away, i);
        if (!(at_beam > -1.0 && at_beam < (double)range.count && away_m < farthest_m))
            continue;
        beam middle = (beam)floor(at_beam), last = middle + REAR_PLACES_SAME_PLACE_BEAMS;
        for (beam b = middle - REAR_PLACES_SAME_PLACE_BEAMS; b <= last; b++)
            if (b >= 0 && b < range.count && fabs(NUMBER(range, b) - away_m) < REAR_PLACES_SAME_PLACE_M &&
                fabs((double)b - at_beam) <= REAR_PLACES_SAME_PLACE_BEAMS)
                again[b] = 1;
    }
    for (beam k = 0; k < beams.count; k++)
        DATA(npy_bool, answer)[k] = again[INDEX(beams, k)];
    free(again);
    return answer;
}

/* expected_m(beams, away, at_beam) -> ranges */
KERNEL(expected_m) {
    struct row away, at;
    beam beams;
    if (!enough(count, 3, "expected_m") || !as_indices(given, 1, &beams) || !as_row(given[1], NPY_DOUBLE, &away) ||
        !as_row(given[2], NPY_DOUBLE, &at))
        return NULL;
    if (away.count != at.count || beams < 0 || beams > 1 << 20) /* no lidar has so many: gigabytes, for seconds */
        return PyErr_Format(PyExc_ValueError, "expected_m: arrays of different lengths, or too many beams");
    const beam aside = REAR_PLACES_EXPECTED_BEAMS;
    PyObject *answer = fresh(NPY_DOUBLE, beams);
    double *nearest = malloc((size_t)(beams + 2 * aside + 1) * sizeof *nearest);
    if (!answer || !nearest) {
        Py_XDECREF(answer);
        free(nearest);
        return PyErr_NoMemory();
    }
    for (beam b = 0; b < beams + 2 * aside; b++)
        nearest[b] = INFINITY;
    for (beam i = 0; i < at.count; i++) {
        double at_beam = NUMBER(at, i);
        if (at_beam > -0.5 && at_beam < (double)beams - 0.5) {
            double *there = nearest + aside + (beam)rint(at_beam);
            *there = nearer(*there, NUMBER(away, i));
        }
    }
    for (beam b = 0; b < beams; b++) {
        double found = nearest[b];
        for (beam beside = 1; beside <= 2 * aside; beside++)
            found = nearer(found, nearest[b + beside]);
        DATA(double, answer)[b] = found;
    }
    free(nearest);
    return answer;
}
