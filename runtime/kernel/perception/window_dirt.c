/* Twins of runtime/control/perception/window_dirt.py: evidence of dirt on the lidar's window, beam by beam, and the findings. */

#include "arrays.h"
#include "constants.h"

/* Whether the beam at this offset has about the same range; beyond the ends of the fan none has. */
static int hides(const struct row *range, beam i, double range_m) {
    return i >= 0 && i < range->count && NUMBER(*range, i) - range_m < VIEW_DIRT_STANDS_OUT_M;
}

static int stands_out(const struct row *range, beam i) {
    const beam some = WINDOW_DIRT_NEIGHBOUR_BEAMS_0, more = WINDOW_DIRT_NEIGHBOUR_BEAMS_1;
    double range_m = NUMBER(*range, i);
    if (!(range_m < WINDOW_DIRT_SMUDGE_NEARER_THAN_M))
        return 0;
    return range_m < WINDOW_DIRT_ON_THE_WINDOW_M || !((hides(range, i - some, range_m) || hides(range, i + some, range_m)) &&
                                                  (hides(range, i - more, range_m) || hides(range, i + more, range_m)));
}

/* Only beside echoes is silence evidence: how many there are around each beam is counted along the way. */
static void learn_blindness(const struct row *no_echo, const struct row *blind, double turned, double *learnt) {
    const beam aside = WINDOW_DIRT_BESIDE_ECHOES_BEAMS, beams = no_echo->count;
    beam echoes = 0, first = 0, end = 0;
    for (beam i = 0; i < beams; i++) {
        for (; end < beams && end <= i + aside; end++)
            echoes += !FLAG(*no_echo, end);
        for (; first < i - aside; first++)
            echoes -= !FLAG(*no_echo, first);
        double known = NUMBER(*blind, i);
        int tells = (double)echoes >= WINDOW_DIRT_BESIDE_ECHOES_SHARE * (double)(end - first);
        learnt[i] = tells ? known + turned * ((FLAG(*no_echo, i) ? 1.0 : 0.0) - known) : known;
    }
}

/* weigh_dirt(ranges, no_echo, own, rear, near, dirt, body, blind, learns, quickly, turned) -> near, dirt, body, blind */
KERNEL(weigh_dirt) {
    static const int types[] = {NPY_DOUBLE, NPY_BOOL, NPY_BOOL, NPY_BOOL, NPY_DOUBLE, NPY_DOUBLE, NPY_DOUBLE, NPY_DOUBLE};
    struct row rows[8];
    double share[3];
    if (!enough(count, 11, "weigh_dirt") || !as_numbers(given + 8, 3, share))
        return NULL;
    for (int k = 0; k < 8; k++) {
        if (!as_row(given[k], types[k], &rows[k]))
            return NULL;
        if (rows[k].count != rows[0].count)
            return PyErr_Format(PyExc_ValueError, "evidence: arrays of different lengths");
    }
    const struct row range = rows[0], no_echo = rows[1], own = rows[2], rear = rows[3], near = rows[4], dirt = rows[5],
                     body = rows[6], blind = rows[7];
    const double learns = share[0], quickly = share[1], turned = share[2], keeps = 1 - learns;
    const beam beams = range.count;
    PyObject *learnt[4] = {fresh(NPY_DOUBLE, beams), fresh(NPY_DOUBLE, beams), fresh(NPY_DOUBLE, beams),
                           turned != 0 ? fresh(NPY_DOUBLE, beams) : Py_NewRef(given[7])};
    if (!learnt[0] || !learnt[1] || !learnt[2] || !learnt[3]) {
        for (int k = 0; k < 4; k++)
            Py_XDECREF(learnt[k]);
        return NULL;
    }
    double *new_near = DATA(double, learnt[0]), *new_dirt = DATA(double, learnt[1]), *new_body = DATA(double, learnt[2]);
    for (beam i = 0; i < beams; i++) {
        double kept_m = NUMBER(near, i), off_m = NUMBER(range, i) - kept_m, known = NUMBER(dirt, i);
        int stands = stands_out(&range, i), of_body = FLAG(own, i) && FLAG(rear, i);
        new_near[i] = !stands ? kept_m : isnan(kept_m) ? NUMBER(range, i) : kept_m + learns * off_m;
        new_body[i] = NUMBER(body, i) * keeps + (of_body ? learns : 0.0);
        int part = FLAG(rear, i) && new_near[i] < WINDOW_DIRT_BODY_NEARER_THAN_M;
        if (stands && !of_body && !(fabs(off_m) >= WINDOW_DIRT_STEADY_WITHIN_M))
            new_dirt[i] = known + (part ? quickly : learns) * (1 - known);
        else
            new_dirt[i] = part && FLAG(no_echo, i) ? known : known * keeps;
    }
    if (turned != 0)
        learn_blindness(&no_echo, &blind, turned, DATA(double, learnt[3]));
    return Py_BuildValue("(NNNN)", learnt[0], learnt[1], learnt[2], learnt[3]);
}

/* Rows of doubtful beams are dirty from end to end where one of them surely is. */
static void whole_rows(npy_bool *dirty, const npy_bool *surely, beam beams) {
    for (beam i = 0, first = 0, sure = 0; i <= beams; i++) {
        if (i < beams && dirty[i]) {
            sure |= surely[i];
            continue;
        }
        if (!sure)
            memset(dirty + first, 0, (size_t)(i - first));
        first = i + 1;
        sure = 0;
    }
}

/* find_dirt(dirt, body, blind, doubted | None, (dirty, parts, blinded), mask above, unmask below)
 *   -> (dirty, parts, blinded) | None, any */
KERNEL(find_dirt) {
    struct row dirt, body, blind, doubted = {NULL, 0, 0}, before[3];
    double from[2];
    if (!enough(count, 7, "find_dirt") || !as_row(given[0], NPY_DOUBLE, &dirt) ||
        !as_row(given[1], NPY_DOUBLE, &body) || !as_row(given[2], NPY_DOUBLE, &blind) ||
        (given[3] != Py_None && !as_row(given[3], NPY_BOOL, &doubted)) || !as_numbers(given + 5, 2, from))
        return NULL;
    if (!PyTuple_Check(given[4]) || PyTuple_GET_SIZE(given[4]) != 3)
        return PyErr_Format(PyExc_TypeError, "findings wants a tuple of 3 arrays");
    const beam beams = dirt.count;
    int same = body.count == beams && blind.count == beams && (!doubted.data || doubted.count == beams);
    for (int k = 0; k < 3; k++) {
        if (!as_row(PyTuple_GET_ITEM(given[4], k), NPY_BOOL, &before[k]))
            return NULL;
        same &= before[k].count == beams;
    }
    if (!same)
        return PyErr_Format(PyExc_ValueError, "findings: arrays of different lengths");
    npy_bool *dirty = malloc(4 * (size_t)beams + 1);
    if (!dirty)
        return PyErr_NoMemory();
    npy_bool *parts = dirty + beams, *blinded = parts + beams, *surely = blinded + beams;
    for (beam i = 0; i < beams; i++) {
        dirty[i] = NUMBER(dirt, i) >= from[1] && (!doubted.data || FLAG(doubted, i));
        surely[i] = NUMBER(dirt, i) > from[0] || FLAG(before[0], i);
        parts[i] = NUMBER(body, i) > from[0];
        blinded[i] = NUMBER(blind, i) > WINDOW_DIRT_BLIND_ABOVE;
    }
    whole_rows(dirty, surely, beams);
    int changed = 0, any = 0;
    for (beam i = 0; i < beams; i++) {
        any |= dirty[i] || blinded[i];
        changed |= dirty[i] != FLAG(before[0], i) || parts[i] != FLAG(before[1], i) || blinded[i] != FLAG(before[2], i);
    }
    PyObject *now = changed ? Py_BuildValue("(NNN)", copied(NPY_BOOL, beams, dirty), copied(NPY_BOOL, beams, parts),
                                            copied(NPY_BOOL, beams, blinded))
                            : Py_NewRef(Py_None);
    free(dirty);
    return now ? Py_BuildValue("(NN)", now, PyBool_FromLong(any)) : NULL;
}
