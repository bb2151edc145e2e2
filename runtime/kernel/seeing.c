/* Twins of runtime/control/perception.py, movers.py, faint.py, darkness.py: what one scan shows. */

#include "arrays.h"
#include "constants.h"
static void support(const double *range, npy_bool *solid, beam beams) {
    for (beam i = 0; i < beams; i++) {
        int agree = 0;
        agree += i >= 1 && fabs(range[i] - range[i - 1]) <= PERCEPTION_SUPPORT_WITHIN_M;
        agree += i >= 2 && fabs(range[i] - range[i - 2]) <= PERCEPTION_SUPPORT_WITHIN_M;
        agree += i + 1 < beams && fabs(range[i + 1] - range[i]) <= PERCEPTION_SUPPORT_WITHIN_M;
        agree += i + 2 < beams && fabs(range[i + 2] - range[i]) <= PERCEPTION_SUPPORT_WITHIN_M;
        solid[i] = agree >= PERCEPTION_NEIGHBOURS;
    }
}

/* A trail leads away from the last beam that sees a part of the car. */
static void forget_trail(const double *range, npy_bool *solid, beam beams, beam edge, beam step) {
    for (beam i = edge; i + step >= 0 && i + step < beams && range[i + step] - range[i] >= PERCEPTION_TRAIL_STEP_M;) {
        i += step;
        solid[i] = 0;
    }
}

static void forget_trails(const double *range, npy_bool *solid, const npy_bool *part, beam beams) {
    for (beam i = 0; i < beams; i++) {
        if (!part[i])
            continue;
        if (i == 0 || !part[i - 1])
            forget_trail(range, solid, beams, i, -1);
        if (i + 1 == beams || !part[i + 1])
            forget_trail(range, solid, beams, i, 1);
    }
}

static int is_dirt(const double *range, beam beams, beam from, beam to, double step_rad) {
    double width_m = (double)(to - from + 1) * step_rad * least(range[from], range[to]);
    int left_near = to < beams - 1 && range[to + 1] - range[to] < PERCEPTION_DIRT_STANDS_OUT_M;
    int right_near = from > 0 && range[from - 1] - range[from] < PERCEPTION_DIRT_STANDS_OUT_M;
    return width_m < PERCEPTION_DIRT_THINNER_THAN_M && !left_near && !right_near;
}

static void forget_run(const double *range, npy_bool *solid, beam from, beam to) {
    for (beam i = from; i <= to; i++)
        if (range[i] < PERCEPTION_DIRT_NEARER_THAN_M)
            solid[i] = 0;
}

static void forget_thin_dirt(const double *range, npy_bool *solid, beam beams, double step_rad) {
    beam from = -1, last = -1;
    for (beam i = 0; i < beams; i++) {
        if (!(range[i] < PERCEPTION_DIRT_NEARER_THAN_M))
            continue;
        if (from >= 0 && (i - last > PERCEPTION_BRIDGED_BEAMS + 1 || fabs(range[i] - range[last]) >= PERCEPTION_DIRT_STANDS_OUT_M)) {
            if (is_dirt(range, beams, from, last, step_rad))
                forget_run(range, solid, from, last);
            from = -1;
        }
        if (from < 0)
            from = i;
        last = i;
    }
    if (from >= 0 && is_dirt(range, beams, from, last, step_rad))
        forget_run(range, solid, from, last);
}

/* look(ranges, cos, sin, aside, dirty | None, step_rad, lidar_x, front, rear, half_width, near)
 *   -> ranges, x, y, solid, no_echo, own, silent */
KERNEL(look) {
    struct row sent, cosine, sine, aside, dirty = {NULL, 0, 0};
    double v[6];
    if (!enough(count, 11, "look") || !as_row(given[0], NPY_FLOAT, &sent) || !as_row(given[1], NPY_DOUBLE, &cosine) ||
        !as_row(given[2], NPY_DOUBLE, &sine) || !as_row(given[3], NPY_BOOL, &aside) ||
        (given[4] != Py_None && !as_row(given[4], NPY_BOOL, &dirty)) || !as_numbers(given + 5, 6, v))
        return NULL;
    beam beams = sent.count, silent = 0;
    if (cosine.count != beams || sine.count != beams || aside.count != beams || (dirty.data && dirty.count != beams)) {
        PyErr_SetString(PyExc_ValueError, "look: arrays of different lengths");
        return NULL;
    }
    double step_rad = fabs(v[0]), lidar_x = v[1], front = v[2], rear = v[3], half = v[4], near = v[5];
    PyObject *seen[6];
    for (int i = 0; i < 6; i++)
        seen[i] = fresh(i < 3 ? NPY_DOUBLE : NPY_BOOL, beams);
    npy_bool *part = calloc((size_t)beams + 1, 1);
    if (!part || !seen[0] || !seen[1] || !seen[2] || !seen[3] || !seen[4] || !seen[5]) {
        for (int i = 0; i < 6; i++)
            Py_XDECREF(seen[i]);
        free(part);
        return PyErr_NoMemory();
    }
    double *range = DATA(double, seen[0]), *x = DATA(double, seen[1]), *y = DATA(double, seen[2]);
    npy_bool *solid = DATA(npy_bool, seen[3]), *no_echo = DATA(npy_bool, seen[4]), *own = DATA(npy_bool, seen[5]);
    for (beam i = 0; i < beams; i++) {
        double read = (double)AT(float, sent, i);
        no_echo[i] = !(read > 0.0 && read < INFINITY);
        silent += no_echo[i];
        range[i] = no_echo[i] ? NAN : read;
        x[i] = NUMBER(cosine, i) * range[i] + lidar_x;
        y[i] = NUMBER(sine, i) * range[i];
    }
    support(range, solid, beams);
    int parts = 0, dirt = 0;
    for (beam i = 0; i < beams; i++) {
        own[i] = range[i] < near && x[i] <= front && x[i] >= -rear && fabs(y[i]) <= half;
        if (own[i])
            solid[i] = 0;
        part[i] = own[i] && FLAG(aside, i);
        parts |= part[i];
    }
    if (parts)
        forget_trails(range, solid, part, beams);
    for (beam i = 0; i < beams && !dirt; i++)
        dirt = solid[i] && range[i] < PERCEPTION_DIRT_NEARER_THAN_M;
    if (dirt)
        forget_thin_dirt(range, solid, beams, step_rad);
    if (dirty.data)
        for (beam i = 0; i < beams; i++)
            if (FLAG(dirty, i) && range[i] < PERCEPTION_LEARNT_DIRT_NEARER_THAN_M)
                solid[i] = 0;
    free(part);
    return Py_BuildValue("(NNNNNNn)", seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], silent);
}

/* Whether the first solid of the next beams in this direction is clearly farther away. */
static int behind(const struct row *solid, const struct row *range, beam first, beam step, double range_m) {
    for (beam k = 0, i = first; k < MOVERS_BACKGROUND_BEAMS; k++, i += step) {
        if (i < 0 || i >= solid->count)
            return 0;
        if (FLAG(*solid, i))
            return NUMBER(*range, i) > range_m + MOVERS_JUMP_M;
    }
    return 1;
}

/* small_things(solid, ranges, step_rad) -> [(first, last), ...] */
KERNEL(small_things) {
    struct row solid, range;
    double step_rad;
    if (!enough(count, 3, "small_things") || !as_row(given[0], NPY_BOOL, &solid) ||
        !as_row(given[1], NPY_DOUBLE, &range) || !as_numbers(given + 2, 1, &step_rad))
        return NULL;
    PyObject *things = PyList_New(0);
    beam right = -1, last = -1, points = 0;
    for (beam i = 0; things && i <= solid.count; i++) {
        int ends = i == solid.count;
        if (!ends && !(FLAG(solid, i) && NUMBER(range, i) < MOVERS_WITHIN_M))
            continue;
        int cut = last >= 0 && (ends || i - last > MOVERS_GAP_BEAMS ||
                                fabs(NUMBER(range, i) - NUMBER(range, last)) > MOVERS_JUMP_M);
        if (cut && points >= MOVERS_FEWEST_BEAMS &&
            (double)(last - right) * step_rad * NUMBER(range, right) <= MOVERS_WIDEST_M &&
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

/* thin_places(x, y, solid, ranges, dirty | None, first, last, turned, at) -> places in odom, lonely ones in base_link */
KERNEL(thin_places) {
    struct row x, y, solid, range, dirty = {NULL, 0, 0};
    beam span[2];
    const beam apart = FAINT_STANDS_OUT_BEAMS;
    if (!enough(count, 9, "thin_places") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid) || !as_row(given[3], NPY_DOUBLE, &range) ||
        (given[4] != Py_None && !as_row(given[4], NPY_BOOL, &dirty)) || !as_indices(given + 5, 2, span))
        return NULL;
    if (x.count != range.count || y.count != range.count || solid.count != range.count ||
        (dirty.data && dirty.count != range.count)) {
        PyErr_SetString(PyExc_ValueError, "thin_places: arrays of different lengths");
        return NULL;
    }
    Py_complex turned = PyComplex_AsCComplex(given[7]), at = PyComplex_AsCComplex(given[8]);
    if (PyErr_Occurred())
        return NULL;
    beam from = span[0] < apart ? apart : span[0], to = span[1] > range.count - apart ? range.count - apart : span[1];
    place *found = malloc(2 * sizeof(place) * (size_t)(to > from ? to - from : 1));
    if (!found)
        return PyErr_NoMemory();
    place *lonely = found + (to > from ? to - from : 1);
    beam few = 0, alone = 0;
    for (beam i = from; i < to; i++) {
        double here = NUMBER(range, i);
        if (here < FAINT_WITHIN_M && here > FAINT_FROM_M && !(NUMBER(range, i + apart) - here < FAINT_STANDS_OUT_M) &&
            !(NUMBER(range, i - apart) - here < FAINT_STANDS_OUT_M) && !(dirty.data && FLAG(dirty, i))) {
            place seen = CMPLX(NUMBER(x, i), NUMBER(y, i));
            found[few++] = times(seen, CMPLX(turned.real, turned.imag)) + CMPLX(at.real, at.imag);
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

/* returned(seen, before, turned, at) -> places | None */
KERNEL(returned) {
    struct row seen, old[8];
    if (!enough(count, 4, "returned") || !as_row(given[0], NPY_CDOUBLE, &seen))
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
    Py_complex turned_by = PyComplex_AsCComplex(given[2]), at_m = PyComplex_AsCComplex(given[3]);
    if (PyErr_Occurred())
        return NULL;
    place turned = CMPLX(turned_by.real, turned_by.imag), at = CMPLX(at_m.real, at_m.imag);
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
                    if (fabs(creal(off)) < FAINT_SAME_RANGE_M && fabs(cimag(off)) < FAINT_SAME_ASIDE_M) {
                        same = 1;
                        if (pass)
                            of_scan[j] = 1;
                    }
                }
                again += same && !pass;
                of_scan += old[k].count;
            }
            if (again < FAINT_SCANS - 2)
                break;
        }
        if (again >= FAINT_SCANS - 2) {
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

/* dark_between(no_echo, solid, ranges, first, last, near_m) -> bool */
KERNEL(dark_between) {
    struct row no_echo, solid, range;
    beam span[2], dark = 0, from = -1, to = -1;
    double near_m;
    if (!enough(count, 6, "dark_between") || !as_row(given[0], NPY_BOOL, &no_echo) ||
        !as_row(given[1], NPY_BOOL, &solid) || !as_row(given[2], NPY_DOUBLE, &range) ||
        !as_indices(given + 3, 2, span) || !as_numbers(given + 5, 1, &near_m))
        return NULL;
    if (span[0] < 0 || span[1] > no_echo.count || solid.count != no_echo.count || range.count != no_echo.count) {
        PyErr_SetString(PyExc_ValueError, "dark_between: beams outside the scan");
        return NULL;
    }
    for (beam i = span[0]; i < span[1]; i++)
        if (FLAG(no_echo, i)) {
            dark++;
            if (from < 0)
                from = i;
            to = i;
        }
    if (span[1] <= span[0] || (double)dark <= DARKNESS_DARK_SHARE * (double)(span[1] - span[0]))
        Py_RETURN_FALSE;
    beam right = from - 1, left = to + 1;
    while (right >= 0 && !FLAG(solid, right))
        right--;
    while (left < solid.count && !FLAG(solid, left))
        left++;
    if (right < 0 || left >= solid.count)
        Py_RETURN_FALSE;
    return PyBool_FromLong(most(NUMBER(range, right), NUMBER(range, left)) < near_m);
}
