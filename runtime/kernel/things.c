/* Twins of runtime/control/safety/moving_obstacles.py, thin_obstacles.py, no_return_regions.py and rear_memory.py:
 * small, thin and near obstacles, and regions without echo.
 */

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

/* find_dark_regions(no_echo, solid, ranges, angle_min, angle_step, toward, near_m) -> bool */
KERNEL(find_dark_regions) {
    struct row no_echo, solid, range;
    double v[4];
    if (!enough(count, 7, "find_dark_regions") || !as_row(given[0], NPY_BOOL, &no_echo) ||
        !as_row(given[1], NPY_BOOL, &solid) || !as_row(given[2], NPY_DOUBLE, &range) || !as_numbers(given + 3, 4, v))
        return NULL;
    if (solid.count != no_echo.count || range.count != no_echo.count) {
        PyErr_SetString(PyExc_ValueError, "dark_around: arrays of different lengths");
        return NULL;
    }
    if (!v[1]) {
        PyErr_SetString(PyExc_ZeroDivisionError, "float division by zero");
        return NULL;
    }
    /* of two equally near beams the even one, as Python's round */
    double middle = rint((v[2] - v[0]) / v[1]), width = rint(NO_RETURN_REGIONS_DARK_WINDOW_RAD / fabs(v[1])), near_m = v[3];
    if (!isfinite(middle) || !isfinite(width))
        return PyLong_FromDouble(isfinite(middle) ? width : middle); /* fails as round does */
    const beam first = (beam)within(middle - width, 0.0, (double)no_echo.count);
    const beam last = (beam)within(middle + width + 1, 0.0, (double)no_echo.count);
    beam dark = 0, from = -1, to = -1;
    for (beam i = first; i < last; i++)
        if (FLAG(no_echo, i)) {
            dark++;
            if (from < 0)
                from = i;
            to = i;
        }
    if (last <= first || (double)dark <= NO_RETURN_REGIONS_DARK_SHARE * (double)(last - first))
        Py_RETURN_FALSE;
    beam right = from - 1, left = to + 1;
    while (right >= 0 && !FLAG(solid, right))
        right--;
    while (left < solid.count && !FLAG(solid, left))
        left++;
    if (right < 0 || left >= solid.count)
        Py_RETURN_FALSE;
    return PyBool_FromLong(greater(NUMBER(range, right), NUMBER(range, left)) < near_m);
}

/* find_near_places(x, y, solid, ranges, at x, at y, yaw) -> places in odom */
KERNEL(find_near_places) {
    struct row x, y, solid, range;
    double v[3];
    if (!enough(count, 7, "find_near_places") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid) || !as_row(given[3], NPY_DOUBLE, &range) || !as_numbers(given + 4, 3, v))
        return NULL;
    if (x.count != range.count || y.count != range.count || solid.count != range.count)
        return PyErr_Format(PyExc_ValueError, "near_places: arrays of different lengths");
    if (isinf(v[2]))
        return PyErr_Format(PyExc_ValueError, "math domain error");
    beam few = 0;
    for (beam i = 0; i < range.count; i++)
        few += FLAG(solid, i) && NUMBER(range, i) < REAR_MEMORY_NEAR_M;
    PyObject *answer = fresh(NPY_CDOUBLE, few);
    if (!answer)
        return NULL;
    place turned = CMPLX(cos(v[2]), sin(v[2])), at = CMPLX(v[0], v[1]), *to = DATA(place, answer);
    for (beam i = 0; i < range.count; i++)
        if (FLAG(solid, i) && NUMBER(range, i) < REAR_MEMORY_NEAR_M)
            *to++ = times(CMPLX(NUMBER(x, i), NUMBER(y, i)), turned) + at;
    return answer;
}

/* places_behind(places, at x, at y, yaw, lidar x, half view) -> places in base_link */
KERNEL(places_behind) {
    struct row from;
    double v[5];
    if (!enough(count, 6, "places_behind") || !as_row(given[0], NPY_CDOUBLE, &from) || !as_numbers(given + 1, 5, v))
        return NULL;
    if (isinf(v[2]))
        return PyErr_Format(PyExc_ValueError, "math domain error");
    place turned = CMPLX(cos(-v[2]), sin(-v[2])), at = CMPLX(v[0], v[1]), *found = NULL;
    const double lidar_x = v[3], half_view = v[4], cosine = half_view < M_PI ? cos(half_view) : -INFINITY;
    beam few = 0, most_places = 0;
    for (beam i = 0; i < from.count; i++) {
        place here = times(PLACE(from, i) - at, turned);
        double x = creal(here), y = cimag(here), ahead = x - lidar_x;
        if (!(x * x + y * y < REAR_MEMORY_NEAR_M * REAR_MEMORY_NEAR_M) ||
            !((half_view < 0.0 && ahead == ahead) || ahead < cosine * sqrt(ahead * ahead + y * y)))
            continue;
        if (few == most_places) { /* one large buffer for all would cost more than the loop */
            most_places = 2 * most_places + 512;
            place *larger = realloc(found, sizeof *found * (size_t)most_places);
            if (!larger) {
                free(found);
                return PyErr_NoMemory();
            }
            found = larger;
        }
        found[few++] = here;
    }
    PyObject *answer = copied(NPY_CDOUBLE, few, found);
    free(found);
    return answer;
}
