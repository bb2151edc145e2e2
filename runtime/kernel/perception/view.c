/* Twin of runtime/control/perception/view.py: the view of one scan. */

#include "arrays.h"
#include "constants.h"

static void support(const double *range, npy_bool *solid, beam beams) {
    for (beam i = 0; i < beams; i++) {
        int agree = 0;
        agree += i >= 1 && fabs(range[i] - range[i - 1]) <= VIEW_SUPPORT_WITHIN_M;
        agree += i >= 2 && fabs(range[i] - range[i - 2]) <= VIEW_SUPPORT_WITHIN_M;
        agree += i + 1 < beams && fabs(range[i + 1] - range[i]) <= VIEW_SUPPORT_WITHIN_M;
        agree += i + 2 < beams && fabs(range[i + 2] - range[i]) <= VIEW_SUPPORT_WITHIN_M;
        solid[i] = agree >= VIEW_NEIGHBOURS;
    }
}

/* A trail leads away from the last beam that sees a part of the car, over its rim. */
static void forget_trail(const double *range, npy_bool *solid, beam beams, beam edge, beam step, int has_rim) {
    for (beam i = edge + step, far = has_rim ? edge + step * VIEW_RIM_BEAMS : edge;
         i >= 0 && i < beams && ((far - i) * step >= 0 || range[i] - range[i - step] >= VIEW_TRAIL_STEP_M); i += step)
        solid[i] = 0;
}

static void forget_trails(const double *range, npy_bool *solid, const npy_bool *part, beam beams) {
    for (beam i = 0; i < beams; i++) {
        if (!part[i])
            continue;
        int begins = i == 0 || !part[i - 1], ends = i + 1 == beams || !part[i + 1];
        if (begins)
            forget_trail(range, solid, beams, i, -1, !ends);
        if (ends)
            forget_trail(range, solid, beams, i, 1, !begins);
    }
}

static int is_dirt(const double *range, beam beams, beam from, beam to, double step_rad) {
    double width_m = (double)(to - from + 1) * step_rad * least(range[from], range[to]);
    int left_near = to < beams - 1 && range[to + 1] - range[to] < VIEW_DIRT_STANDS_OUT_M;
    int right_near = from > 0 && range[from - 1] - range[from] < VIEW_DIRT_STANDS_OUT_M;
    return width_m < VIEW_DIRT_THINNER_THAN_M && !left_near && !right_near;
}

static void forget_run(const double *range, npy_bool *solid, beam from, beam to) {
    for (beam i = from; i <= to; i++)
        if (range[i] < VIEW_DIRT_NEARER_THAN_M)
            solid[i] = 0;
}

static void forget_thin_dirt(const double *range, npy_bool *solid, beam beams, double step_rad) {
    beam from = -1, last = -1;
    for (beam i = 0; i < beams; i++) {
        if (!(range[i] < VIEW_DIRT_NEARER_THAN_M))
            continue;
        if (from >= 0 && (i - last > VIEW_BRIDGED_BEAMS + 1 ||
                          fabs(range[i] - range[last]) >= VIEW_DIRT_STANDS_OUT_M)) {
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

/* view_scan(ranges, cos, sin, aside, ignored_below, step_rad, lidar_x, lidar_y, front, rear, half_width, near)
 *   -> ranges, x, y, solid, no_echo, own, silent */
KERNEL(view_scan) {
    struct row sent, cosine, sine, aside, ignored;
    double v[7];
    if (!enough(count, 12, "view_scan") || !as_row(given[0], NPY_FLOAT, &sent) || !as_row(given[1], NPY_DOUBLE, &cosine) ||
        !as_row(given[2], NPY_DOUBLE, &sine) || !as_row(given[3], NPY_BOOL, &aside) ||
        !as_row(given[4], NPY_DOUBLE, &ignored) || !as_numbers(given + 5, 7, v))
        return NULL;
    beam beams = sent.count, silent = 0;
    if (cosine.count != beams || sine.count != beams || aside.count != beams ||
        ignored.count != beams) {
        PyErr_SetString(PyExc_ValueError, "look: arrays of different lengths");
        return NULL;
    }
    double step_rad = fabs(v[0]), lidar_x = v[1], lidar_y = v[2], front = v[3], rear = v[4], half = v[5], near = v[6];
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
        y[i] = NUMBER(sine, i) * range[i] + lidar_y;
    }
    support(range, solid, beams);
    int parts = 0, dirt = 0;
    for (beam i = 0; i < beams; i++) {
        own[i] = range[i] < near && x[i] <= front && x[i] >= -rear && fabs(y[i]) <= half;
        int skipped = own[i] || range[i] < NUMBER(ignored, i);
        if (skipped)
            solid[i] = 0;
        part[i] = skipped && FLAG(aside, i);
        parts |= part[i];
    }
    if (parts)
        forget_trails(range, solid, part, beams);
    for (beam i = 0; i < beams && !dirt; i++)
        dirt = solid[i] && range[i] < VIEW_DIRT_NEARER_THAN_M;
    if (dirt)
        forget_thin_dirt(range, solid, beams, step_rad);
    free(part);
    return Py_BuildValue("(NNNNNNn)", seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], silent);
}
