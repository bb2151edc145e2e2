/* Twin of runtime/control/perception/visibility/lidar_sectors.py: the state of each sector after one more scan. */

#include "arrays.h"
#include "constants.h"

enum { SEEN, DEPTH, GONE, UNPROVEN, MISSING, BLIND };

/* Present bearing of a place (base_link, one scan ago), in sectors; NaN for none. v: first_rad, width_rad, the lidar's
 * x and y, within_m, moved since. */
static double carried(place held, place turn, const double *v) {
    if (isnan(creal(held)))
        return NAN;
    place off = times(held - CMPLX(v[5], v[6]), turn) - CMPLX(v[2], v[3]);
    if (!(creal(off) * creal(off) + cimag(off) * cimag(off) < v[4] * v[4]))
        return NAN;
    return (atan2(cimag(off), creal(off)) - v[0]) / v[1];
}

/* The sectors between two neighbours that have seen are expected to see. */
static void expect(double right, double left, npy_bool *expected, beam sectors) {
    right -= LIDAR_SECTORS_BESIDE_SECTORS;
    left += LIDAR_SECTORS_BESIDE_SECTORS;
    if (!(left > right && left - right <= LIDAR_SECTORS_MAX_BETWEEN_SECTORS))
        return;
    for (int step = 0; step < 3; step++) {
        double at = ceil(right) + (double)step;
        if (at <= left && at >= 0 && at < (double)sectors)
            expected[(beam)at] = 1;
    }
}

/* Which sectors are expected to see, by the place held by each; computed only where a sector is silent. */
static void expect_all(const struct row *held, const double *v, double turned, npy_bool *expected) {
    const place turn = CMPLX(cos(-turned), sin(-turned));
    double before = NAN;
    for (beam k = 0; v[4] > 0.0 && k < held->count; k++) {
        double at = carried(PLACE(*held, k), turn, v);
        expect(before, at, expected, held->count);
        before = at;
    }
}

/* The longest row of near beams of which a third are within the outline. */
static beam row_on_lidar(const struct row *x, const struct row *y, const struct row *own, beam from, beam end,
                         double front_m, double half_m) {
    beam longest = 0, begin = -1, last = -1, inside = 0;
    for (beam i = from; i <= end; i++) {
        int near = i < end && NUMBER(*x, i) <= front_m && fabs(NUMBER(*y, i)) <= half_m;
        if (begin >= 0 && (i == end || (near && i - last > LIDAR_SECTORS_ON_LIDAR_GAP_BEAMS))) {
            if (3 * inside >= last - begin + 1 && last - begin + 1 > longest)
                longest = last - begin + 1;
            begin = -1;
        }
        if (!near)
            continue;
        if (begin < 0) {
            begin = i;
            inside = 0;
        }
        last = i;
        inside += FLAG(*own, i) != 0;
    }
    return longest;
}

/* watch_sectors(ranges, x, y, no_echo, own, dirty | None, state, held, first, beams, first_rad, width_rad, lidar_x, lidar_y, front,
 *         half_width, within, moved_x, moved_y, turned) -> state, seen, held, row, suspects, gone */
KERNEL(watch_sectors) {
    static const int types[] = {NPY_DOUBLE, NPY_DOUBLE, NPY_DOUBLE, NPY_BOOL, NPY_BOOL, NPY_BOOL, NPY_INT8, NPY_CDOUBLE};
    struct row rows[8] = {{NULL, 0, 0}};
    beam sizes[2];
    double v[10];
    if (!enough(count, 20, "watch_sectors") || !as_indices(given + 8, 2, sizes) || !as_numbers(given + 10, 10, v))
        return NULL;
    for (int k = 0; k < 8; k++) {
        if (k == 5 && given[k] == Py_None)
            continue;
        if (!as_row(given[k], types[k], &rows[k]))
            return NULL;
    }
    const struct row range = rows[0], x = rows[1], y = rows[2], no_echo = rows[3], own = rows[4], dirty = rows[5],
                     state = rows[6], held = rows[7];
    const beam first = sizes[0], beams = sizes[1], sectors = state.count;
    if (x.count != range.count || y.count != range.count || no_echo.count != range.count || own.count != range.count ||
        (dirty.data && dirty.count != range.count) || held.count != sectors || first < 0 || beams < 1 || sectors < 1 ||
        first > range.count || sectors > range.count || beams > range.count || sectors * beams > range.count - first) {
        PyErr_SetString(PyExc_ValueError, "watched: arrays of different lengths");
        return NULL;
    }
    const beam end = first + sectors * beams;
    const double first_rad = v[0], width_rad = v[1], front_m = v[4], half_m = v[5];
    const double known[] = {first_rad, width_rad, v[2], v[3], v[6], v[7], v[8]};
    PyObject *next = fresh(NPY_INT8, sectors), *seen = fresh(NPY_CDOUBLE, sectors), *full = fresh(NPY_CDOUBLE, sectors);
    npy_bool *expected = calloc((size_t)sectors, 1), *echo = calloc((size_t)(end - first) + 1, 1);
    if (!next || !seen || !full || !expected || !echo) {
        Py_XDECREF(next);
        Py_XDECREF(seen);
        Py_XDECREF(full);
        free(expected);
        free(echo);
        return PyErr_NoMemory();
    }
    for (beam i = 0; i < end - first; i++)
        echo[i] = !FLAG(no_echo, first + i) && !FLAG(own, first + i);
    if (dirty.data)
        for (beam i = 0; i < end - first; i++)
            if (FLAG(dirty, first + i) && NUMBER(range, first + i) < VIEW_LEARNT_DIRT_NEARER_THAN_M)
                echo[i] = 0;
    npy_bool *linked = echo; /* in place: each beam with one before or behind it that agrees */
    for (beam i = 0, before = 0; i < end - first; i++) {
        beam next_one = i + 1 < end - first ? i + 1 : i; /* beyond the last one is none */
        double range_m = NUMBER(range, first + i), off_m = NUMBER(range, first + next_one) - range_m;
        int same = fabs(off_m) <= LIDAR_SECTORS_SAME_THING_M + LIDAR_SECTORS_SAME_THING_SHARE * range_m;
        int agrees = echo[i] & echo[i + 1] & same;
        linked[i] = agrees || before;
        before = agrees;
    }
    npy_int8 *now = DATA(npy_int8, next);
    beam suspects = 0, gone = 0, ahead_from = end, ahead_end = first;
    int expects = 0; /* whether the expectation has been computed */
    for (beam k = 0; k < sectors; k++) {
        const npy_bool *beam_linked = linked + k * beams;
        beam seeing = 0, pick = first + k * beams;
        for (beam n = 0; n < beams; n++)
            seeing += beam_linked[n];
        for (beam right = (beams - 1) / 2, left = beams / 2; right >= 0 && seeing; right--, left++)
            if (beam_linked[right] || beam_linked[left]) {
                pick += beam_linked[right] ? right : left;
                break;
            }
        int sees = (double)seeing >= most(2.0, LIDAR_SECTORS_SEES_SHARE * (double)beams);
        int silent = !sees && (double)seeing <= LIDAR_SECTORS_SILENT_SHARE * (double)beams;
        if (silent && !expects) {
            expects = 1;
            expect_all(&held, known, v[9], expected);
        }
        npy_int8 was = AT(npy_int8, state, k);
        const place at = CMPLX(NUMBER(x, pick), NUMBER(y, pick)), nothing = CMPLX(NAN, NAN);
        DATA(place, seen)[k] = sees ? at : nothing;
        DATA(place, full)[k] = sees && (double)seeing >= LIDAR_SECTORS_FULL_SHARE * (double)beams ? at : nothing;
        now[k] = was == MISSING || was == GONE ? was - 1 : was;
        if (silent && was == SEEN)
            now[k] = GONE;
        if (silent && expected[k] && was != BLIND)
            now[k] = MISSING;
        if (sees)
            now[k] = SEEN;
        gone += now[k] == GONE || now[k] == MISSING;
        if (fabs(first_rad + width_rad * (double)k) <= LIDAR_SECTORS_AHEAD_RAD) {
            suspects += now[k] >= UNPROVEN;
            ahead_from = ahead_from < first + k * beams ? ahead_from : first + k * beams;
            ahead_end = first + (k + 1) * beams;
        }
    }
    free(echo);
    free(expected);
    beam row = row_on_lidar(&x, &y, &own, ahead_from, ahead_end, front_m + LIDAR_SECTORS_ON_LIDAR_SPARE_M,
                            half_m + LIDAR_SECTORS_ON_LIDAR_SPARE_M);
    return Py_BuildValue("(NNNnnn)", next, seen, full, row, suspects, gone);
}
