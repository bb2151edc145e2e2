/* Twins of runtime/control/wall_following/followed_wall.py: selection of the points of the followed wall, and of the room beside it. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* Whether a piece of wall, from its far end on, is a corridor's other wall; see _is_opposite. */
static int is_opposite(const struct row *x, const struct row *y, const npy_intp *index, beam points) {
    beam last = (points < FOLLOWED_WALL_CROSSING_POINTS ? points : FOLLOWED_WALL_CROSSING_POINTS) - 1;
    double x0 = NUMBER(*x, index[0]), y0 = NUMBER(*y, index[0]);
    int comes_back = NUMBER(*y, index[points - 1]) <= 0.0 && NUMBER(*x, index[points - 1]) < x0;
    return fabs(NUMBER(*x, index[last]) - x0) > fabs(NUMBER(*y, index[last]) - y0) && (y0 <= 0.0 || comes_back);
}

static double apart2(const struct row *x, const struct row *y, npy_intp one, npy_intp other) {
    double dx = NUMBER(*x, other) - NUMBER(*x, one), dy = NUMBER(*y, other) - NUMBER(*y, one);
    return dx * dx + dy * dy;
}

/* Put the beams of the wall, from `*from` on, where the caller frees them; return how many, or -1. See wall_piece. */
static beam piece_of(const struct row *x, const struct row *y, const struct row *range, const struct row *solid,
                     const beam *beside, double gap_m, npy_intp **to, beam *from) {
    npy_intp *index = malloc(sizeof(npy_intp) * (size_t)(solid->count + 1));
    if (!index) {
        PyErr_NoMemory();
        return -1;
    }
    beam points = 0, nearest = -1;
    for (beam i = 0; i < solid->count; i++) {
        if (!(FLAG(*solid, i) && NUMBER(*range, i) < FOLLOWED_WALL_CAP_M))
            continue;
        if (i >= beside[0] && i < beside[1] &&
            (nearest < 0 || NUMBER(*range, i) < NUMBER(*range, index[nearest])))
            nearest = points;
        index[points++] = i;
    }
    beam start = 0, end = points;
    if (points < FOLLOWED_WALL_MIN_POINTS || nearest < 0)
        end = 0;
    double crossing2 = FOLLOWED_WALL_CROSSING_M * FOLLOWED_WALL_CROSSING_M, gap2 = gap_m * gap_m, jump2 = least(gap2, crossing2);
    for (beam jump = 0; jump + 1 < end; jump++) {
        double square = apart2(x, y, index[jump], index[jump + 1]);
        if (!(square > jump2))
            continue;
        beam piece_end = jump + 1;
        while (piece_end + 1 < points && !(apart2(x, y, index[piece_end], index[piece_end + 1]) > jump2))
            piece_end++;
        int crosses = NUMBER(*y, index[jump]) > 0.0 && square > crossing2 &&
                      is_opposite(x, y, index + jump + 1, piece_end - jump);
        if (square > gap2 || crosses) {
            if (jump >= nearest) {
                end = jump + 1;
                break;
            }
            start = jump + 1;
        }
    }
    *to = index;
    *from = start;
    return end - start >= FOLLOWED_WALL_MIN_POINTS ? end - start : 0;
}

beam outline_of(const struct row *x, const struct row *y, const struct row *wall, beam more, place **to) {
    const beam points = wall->count, window = FOLLOWED_WALL_SMOOTHED_POINTS, half = window / 2;
    place *total = malloc(sizeof(place) * (size_t)(2 * points + more + 1));
    if (!total) {
        PyErr_NoMemory();
        return -1;
    }
    place *places = total + points;
    for (beam i = 0; i < points; i++) {
        npy_intp from = INDEX(*wall, i);
        if (from < 0 || from >= x->count || from >= y->count) {
            free(total);
            PyErr_Format(PyExc_IndexError, "outline: no beam %zd", (Py_ssize_t)from);
            return -1;
        }
        places[i] = CMPLX(NUMBER(*x, from), NUMBER(*y, from));
        total[i] = i ? total[i - 1] + places[i] : places[i];
    }
    if (points > window) {
        for (beam i = window; i < points; i++)
            places[i - half] = (total[i] - total[i - window]) * (1.0 / (double)window);
        places[half] = total[window - 1] / (double)window;
    }
    beam kept = 0, cell = -1;
    double way_m = 0.0;
    *to = total; /* the sums are not needed any more */
    if (points)
        total[kept++] = places[0];
    for (beam i = 1; i < points; i++) {
        way_m += cabs(places[i] - places[i - 1]);
        double cells = way_m * (1 / FOLLOWED_WALL_THINNED_TO_M);
        beam here = cells < (double)(PY_SSIZE_T_MAX / 2) ? (beam)cells : PY_SSIZE_T_MIN; /* NaN: as numpy casts it */
        if (i > 1 && here != cell)
            total[kept++] = places[i - 1];
        cell = here;
    }
    if (points > 1)
        total[kept++] = places[points - 1];
    return kept;
}

/* The mean of this many of the smallest numbers; sorts these to the beginning. */
static double mean_of_least(double *numbers, beam count, beam wanted) {
    double sum = 0.0;
    for (beam i = 0; i < count; i++) {
        double number = numbers[i];
        beam at = i < wanted ? i : wanted;
        if (at == wanted && !(number < numbers[wanted - 1]))
            continue;
        at -= at == wanted;
        for (; at > 0 && number < numbers[at - 1]; at--)
            numbers[at] = numbers[at - 1];
        numbers[at] = number;
    }
    for (beam i = 0; i < wanted; i++)
        sum += numbers[i];
    return sum / (double)wanted;
}

/* The room beside a line, where every beam from one on may be on the other side; negative on failure. See room_for. */
static double room_for(const struct row *x, const struct row *y, const struct row *range, const struct row *solid,
                       beam from, const struct wall_line *line, double desired_m) {
    double line_m = line->distance_m, cosine = cos(line->heading_rad), sine = sin(line->heading_rad);
    double reach_m = 2 * desired_m - line_m + FOLLOWED_WALL_ROOM_REACH_M, room_m = desired_m;
    const beam every = FOLLOWED_WALL_ROOM_EVERY_BEAM;
    beam near = 0, few = 0;
    for (beam i = from; i < range->count; i += every)
        near += NUMBER(*range, i) < reach_m;
    if (near < FOLLOWED_WALL_MIN_POINTS)
        return desired_m;
    double *across = malloc(sizeof(double) * (size_t)solid->count);
    if (!across) {
        PyErr_NoMemory();
        return -1.0;
    }
    for (beam i = from; i < solid->count; i += every) {
        double along = cosine * NUMBER(*x, i) + sine * NUMBER(*y, i);
        double aside = sine * NUMBER(*x, i) - cosine * NUMBER(*y, i);
        if (FLAG(*solid, i) && fabs(along) < FOLLOWED_WALL_ROOM_BESIDE_M && aside > 0.0)
            across[few++] = aside;
    }
    if (few >= FOLLOWED_WALL_MIN_POINTS) {
        beam nearest = (beam)rint(FOLLOWED_WALL_ROOM_NEAREST_SHARE * (double)few);
        double half_m = (line_m + mean_of_least(across, few, nearest < 1 ? 1 : nearest)) / 2;
        if (half_m < desired_m - FOLLOWED_WALL_ROOM_MIN_GAIN_M)
            room_m = half_m;
    }
    free(across);
    return room_m;
}

/* The beam at the far end of a pane of glass beyond the beam `end`, or -1; see pane_to. */
static beam pane_to(const struct row *x, const struct row *y, const struct row *range, const struct row *solid,
                    const struct row *no_echo, beam end, const struct wall_line *line) {
    double cosine = cos(line->heading_rad), sine = sin(line->heading_rad);
    beam silent = 0, points = 0, far = -1, all = x->count;
    for (beam i = end + 1; i <= end + FOLLOWED_WALL_GLASS_FIRST_BEAMS && i < all; i++)
        silent += FLAG(*no_echo, i);
    if (silent < FOLLOWED_WALL_GLASS_FIRST_BEAMS / 2)
        return -1;
    for (beam i = end + 1; i < all; i++) {
        double off = cosine * NUMBER(*y, i) - sine * NUMBER(*x, i) - line->distance_m;
        if (!(FLAG(*solid, i) && NUMBER(*range, i) < FOLLOWED_WALL_GLASS_RANGE_M && fabs(off) < FOLLOWED_WALL_GLASS_ON_LINE_M))
            continue;
        far = points ? far : i;
        points++;
    }
    if (points < FOLLOWED_WALL_MIN_POINTS || far <= end + 1)
        return -1;
    double gap = hypot(NUMBER(*x, far) - NUMBER(*x, end), NUMBER(*y, far) - NUMBER(*y, end));
    silent = 0;
    for (beam i = end + 1; i < far; i++)
        silent += FLAG(*no_echo, i);
    double share = (double)silent / (double)(far - end - 1);
    int is_pane = FOLLOWED_WALL_THINNED_TO_M < gap && gap < FOLLOWED_WALL_GLASS_GAP_M && share > FOLLOWED_WALL_GLASS_SILENT_SHARE;
    return is_pane ? far : -1;
}

/* find_followed_wall(x, y, ranges, solid, no_echo, beside_from, beside_to, opposite_from, gap_m, beams, rear, front,
 * expected_m, expected_rad, desired_m) -> (indices, (distance, heading, inliers) | None, room_m, glass_to) | None */
KERNEL(find_followed_wall) {
    struct row x, y, range, solid, no_echo, beams, rear, front;
    beam side[3], from;
    double gap_m, v[3];
    if (!enough(count, 15, "find_followed_wall") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_DOUBLE, &range) || !as_row(given[3], NPY_BOOL, &solid) ||
        !as_row(given[4], NPY_BOOL, &no_echo) || !as_indices(given + 5, 3, side) || !as_numbers(given + 8, 1, &gap_m) ||
        !as_row(given[9], NPY_INTP, &beams) || !as_row(given[10], NPY_INTP, &rear) ||
        !as_row(given[11], NPY_INTP, &front) || !as_numbers(given + 12, 3, v))
        return NULL;
    if (x.count != solid.count || y.count != solid.count || range.count != solid.count || no_echo.count != solid.count)
        return PyErr_Format(PyExc_ValueError, "wall_beside: arrays of different lengths");
    if (side[0] < 0 || side[1] < 0 || side[2] < 0)
        return PyErr_Format(PyExc_ValueError, "wall_beside: beams are counted from 0");
    npy_intp *piece;
    beam points = piece_of(&x, &y, &range, &solid, side, gap_m, &piece, &from);
    if (points < 0)
        return NULL;
    struct wall_line line;
    enum found found = points ? find_line(&x, &y, &range, &solid, &beams, &rear, &front, v, &line) : NONE;
    double room_m = found == FOUND ? room_for(&x, &y, &range, &solid, side[2], &line, v[2]) : v[2];
    PyObject *wall = points ? copied(NPY_INTP, points, piece + from) : Py_NewRef(Py_None);
    beam end = points ? piece[from + points - 1] : 0;
    free(piece);
    if (!points || !wall || PyErr_Occurred()) {
        if (PyErr_Occurred())
            Py_CLEAR(wall);
        return wall;
    }
    if (found == NONE)
        return Py_BuildValue("(NOdi)", wall, Py_None, room_m, -1);
    beam glass_to = pane_to(&x, &y, &range, &solid, &no_echo, end, &line);
    return Py_BuildValue("(N(ddn)dn)", wall, line.distance_m, line.heading_rad, line.inliers, room_m, glass_to);
}
