/* Twins of runtime/control/my_wall.py: which points are the followed wall, and how much room there is beside it. */

#include "arrays.h"
#include "constants.h"

/* Whether a piece of wall, from its far end on, is a corridor's other wall; see _is_opposite. */
static int is_opposite(const struct row *x, const struct row *y, const npy_intp *index, beam points) {
    beam last = (points < MY_WALL_CROSSING_POINTS ? points : MY_WALL_CROSSING_POINTS) - 1;
    double x0 = NUMBER(*x, index[0]), y0 = NUMBER(*y, index[0]);
    int comes_back = NUMBER(*y, index[points - 1]) <= 0.0 && NUMBER(*x, index[points - 1]) < x0;
    return fabs(NUMBER(*x, index[last]) - x0) > fabs(NUMBER(*y, index[last]) - y0) && (y0 <= 0.0 || comes_back);
}

static double apart2(const struct row *x, const struct row *y, npy_intp one, npy_intp other) {
    double dx = NUMBER(*x, other) - NUMBER(*x, one), dy = NUMBER(*y, other) - NUMBER(*y, one);
    return dx * dx + dy * dy;
}

/* wall_piece(x, y, ranges, solid, beside_from, beside_to, gap_m) -> indices | None */
KERNEL(wall_piece) {
    struct row x, y, range, solid;
    beam beside[2];
    double gap_m;
    if (!enough(count, 7, "wall_piece") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_DOUBLE, &range) || !as_row(given[3], NPY_BOOL, &solid) ||
        !as_indices(given + 4, 2, beside) || !as_numbers(given + 6, 1, &gap_m))
        return NULL;
    if (x.count != solid.count || y.count != solid.count || range.count != solid.count) {
        PyErr_SetString(PyExc_ValueError, "wall_piece: arrays of different lengths");
        return NULL;
    }
    npy_intp *index = malloc(sizeof(npy_intp) * (size_t)(solid.count + 1));
    if (!index)
        return PyErr_NoMemory();
    beam points = 0, nearest = -1;
    for (beam i = 0; i < solid.count; i++) {
        if (!(FLAG(solid, i) && NUMBER(range, i) < MY_WALL_CAP_M))
            continue;
        if (i >= beside[0] && i < beside[1] &&
            (nearest < 0 || NUMBER(range, i) < NUMBER(range, index[nearest])))
            nearest = points;
        index[points++] = i;
    }
    beam start = 0, end = points;
    if (points < MY_WALL_FEWEST_POINTS || nearest < 0)
        end = 0;
    double crossing2 = MY_WALL_CROSSING_M * MY_WALL_CROSSING_M, gap2 = gap_m * gap_m, jump2 = least(gap2, crossing2);
    for (beam jump = 0; jump + 1 < end; jump++) {
        double square = apart2(&x, &y, index[jump], index[jump + 1]);
        if (!(square > jump2))
            continue;
        beam piece_end = jump + 1;
        while (piece_end + 1 < points && !(apart2(&x, &y, index[piece_end], index[piece_end + 1]) > jump2))
            piece_end++;
        int crosses = NUMBER(y, index[jump]) > 0.0 && square > crossing2 &&
                      is_opposite(&x, &y, index + jump + 1, piece_end - jump);
        if (square > gap2 || crosses) {
            if (jump >= nearest) {
                end = jump + 1;
                break;
            }
            start = jump + 1;
        }
    }
    int found = end - start >= MY_WALL_FEWEST_POINTS;
    PyObject *answer = found ? copied(NPY_INTP, end - start, index + start) : Py_NewRef(Py_None);
    free(index);
    return answer;
}

/* silent_among(no_echo, first, last) -> how many */
KERNEL(silent_among) {
    struct row no_echo;
    beam part[2], silent = 0;
    if (!enough(count, 3, "silent_among") || !as_row(given[0], NPY_BOOL, &no_echo) || !as_indices(given + 1, 2, part))
        return NULL;
    if (part[0] < 0 || part[1] < 0) {
        PyErr_SetString(PyExc_ValueError, "silent_among: beams are counted from 0");
        return NULL;
    }
    for (beam i = part[0]; i < part[1] && i < no_echo.count; i++)
        silent += FLAG(no_echo, i);
    return PyLong_FromSsize_t(silent);
}

/* Put the wall's points, smoothed and thinned, where the caller frees them; return how many, or -1.
 * given: x, y, indices. */
static beam outlined(PyObject *const *given, place **to) {
    struct row x, y, index;
    if (!as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) || !as_row(given[2], NPY_INTP, &index))
        return -1;
    const beam points = index.count, window = MY_WALL_SMOOTHED_POINTS, half = window / 2;
    place *total = malloc(sizeof(place) * (size_t)(2 * points + 1));
    if (!total) {
        PyErr_NoMemory();
        return -1;
    }
    place *places = total + points;
    for (beam i = 0; i < points; i++) {
        npy_intp from = INDEX(index, i);
        if (from < 0 || from >= x.count || from >= y.count) {
            free(total);
            PyErr_Format(PyExc_IndexError, "outline: no beam %zd", (Py_ssize_t)from);
            return -1;
        }
        places[i] = CMPLX(NUMBER(x, from), NUMBER(y, from));
        total[i] = i ? total[i - 1] + places[i] : places[i];
    }
    if (points > window) {
        for (beam i = window; i < points; i++)
            places[i - half] = (total[i] - total[i - window]) * (1.0 / window);
        places[half] = total[window - 1] / window;
    }
    beam kept = 0, cell = -1;
    double way_m = 0.0;
    *to = total; /* nobody needs the sums any more */
    if (points)
        total[kept++] = places[0];
    for (beam i = 1; i < points; i++) {
        way_m += cabs(places[i] - places[i - 1]);
        beam here = (beam)(way_m * (1 / MY_WALL_THINNED_TO_M));
        if (i > 1 && here != cell)
            total[kept++] = places[i - 1];
        cell = here;
    }
    if (points > 1)
        total[kept++] = places[points - 1];
    return kept;
}

/* outline(x, y, indices) -> places */
KERNEL(outline) {
    place *places;
    beam kept = enough(count, 3, "outline") ? outlined(given, &places) : -1;
    if (kept < 0)
        return NULL;
    PyObject *answer = copied(NPY_CDOUBLE, kept, places);
    free(places);
    return answer;
}

/* Ranges, bearings and the nearest range of places seen from (v[0], v[1]) at heading v[2]. */
static PyObject *seen_from(const struct row *places, const double *v) {
    PyObject *ranges = fresh(NPY_DOUBLE, places->count), *bearings = fresh(NPY_DOUBLE, places->count);
    if (!ranges || !bearings) {
        Py_XDECREF(ranges);
        Py_XDECREF(bearings);
        return NULL;
    }
    double nearest = INFINITY;
    place turned = CMPLX(cos(-v[2]), sin(-v[2]));
    for (beam i = 0; i < places->count; i++) {
        place seen = times(PLACE(*places, i) - CMPLX(v[0], v[1]), turned);
        double range = DATA(double, ranges)[i] = greater(cabs(seen), MY_WALL_NEAREST_M);
        nearest = range < nearest || isnan(range) ? range : nearest; /* as numpy's min */
        DATA(double, bearings)[i] = atan2(cimag(seen), creal(seen));
    }
    return Py_BuildValue("(NNd)", ranges, bearings, nearest);
}

/* around(places, x, y, yaw) -> ranges, bearings, nearest, seen from (x, y) at that heading */
KERNEL(around) {
    struct row places;
    double v[3];
    if (!enough(count, 4, "around") || !as_row(given[0], NPY_CDOUBLE, &places) || !as_numbers(given + 1, 3, v))
        return NULL;
    return seen_from(&places, v);
}

/* wall_around(x, y, indices, from x, from y, yaw) -> ranges, bearings, nearest of the outline */
KERNEL(wall_around) {
    place *places;
    double v[3];
    if (!enough(count, 6, "wall_around") || !as_numbers(given + 3, 3, v))
        return NULL;
    beam kept = outlined(given, &places);
    if (kept < 0)
        return NULL;
    struct row row = {(char *)places, sizeof(place), kept};
    PyObject *answer = seen_from(&row, v);
    free(places);
    return answer;
}

static int by_size(const void *one, const void *other) {
    double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

/* room_for(x, y, ranges, solid, line_m, heading_rad, desired_m) -> metres */
KERNEL(room_for) {
    struct row x, y, range, solid;
    double v[3];
    if (!enough(count, 7, "room_for") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_DOUBLE, &range) || !as_row(given[3], NPY_BOOL, &solid) || !as_numbers(given + 4, 3, v))
        return NULL;
    if (x.count != solid.count || y.count != solid.count || range.count != solid.count) {
        PyErr_SetString(PyExc_ValueError, "room_for: arrays of different lengths");
        return NULL;
    }
    double line_m = v[0], cosine = cos(v[1]), sine = sin(v[1]), desired_m = v[2];
    double reach_m = 2 * desired_m - line_m + MY_WALL_ROOM_REACH_M;
    beam near = 0, few = 0;
    for (beam i = 0; i < range.count; i++)
        near += NUMBER(range, i) < reach_m;
    if (near < MY_WALL_FEWEST_POINTS)
        return PyFloat_FromDouble(desired_m);
    double *across = malloc(sizeof(double) * (size_t)solid.count);
    if (!across)
        return PyErr_NoMemory();
    for (beam i = 0; i < solid.count; i++) {
        double along = cosine * NUMBER(x, i) + sine * NUMBER(y, i), aside = sine * NUMBER(x, i) - cosine * NUMBER(y, i);
        if (FLAG(solid, i) && fabs(along) < MY_WALL_ROOM_BESIDE_M && aside > 0.0)
            across[few++] = aside;
    }
    double room_m = desired_m;
    if (few >= MY_WALL_FEWEST_POINTS) {
        beam nearest = (beam)rint(MY_WALL_ROOM_NEAREST_SHARE * (double)few);
        double sum = 0.0;
        nearest = nearest < 1 ? 1 : nearest;
        qsort(across, (size_t)few, sizeof(double), by_size);
        for (beam i = 0; i < nearest; i++)
            sum += across[i];
        double half_m = (line_m + sum / (double)nearest) / 2;
        if (half_m < desired_m - MY_WALL_ROOM_LEAST_GAIN_M)
            room_m = half_m;
    }
    free(across);
    return PyFloat_FromDouble(room_m);
}
