/* Twins of runtime/control/my_wall.py and wall.py: which points are the followed wall, and the line through them. */

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
    double crossing2 = MY_WALL_CROSSING_M * MY_WALL_CROSSING_M, gap2 = gap_m * gap_m;
    for (beam jump = 0; jump + 1 < end; jump++) {
        double square = apart2(&x, &y, index[jump], index[jump + 1]);
        if (!(square > least(gap2, crossing2)))
            continue;
        beam piece_end = jump + 1;
        while (piece_end + 1 < points && !(apart2(&x, &y, index[piece_end], index[piece_end + 1]) > least(gap2, crossing2)))
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

/* outline(x, y, indices) -> places */
KERNEL(outline) {
    struct row x, y, index;
    if (!enough(count, 3, "outline") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_INTP, &index))
        return NULL;
    const beam points = index.count, window = MY_WALL_SMOOTHED_POINTS, half = window / 2;
    place *places = malloc(sizeof(place) * (size_t)(2 * points + 1)), *total = places + points;
    if (!places)
        return PyErr_NoMemory();
    for (beam i = 0; i < points; i++) {
        npy_intp from = INDEX(index, i);
        if (from < 0 || from >= x.count || from >= y.count) {
            free(places);
            return PyErr_Format(PyExc_IndexError, "outline: no beam %zd", (Py_ssize_t)from);
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
    place *to = total; /* never ahead of what is read */
    if (points)
        to[kept++] = places[0];
    for (beam i = 1; i < points; i++) {
        way_m += cabs(places[i] - places[i - 1]);
        beam here = (beam)(way_m * (1 / MY_WALL_THINNED_TO_M));
        if (i > 1 && here != cell)
            to[kept++] = places[i - 1];
        cell = here;
    }
    if (points > 1)
        to[kept++] = places[points - 1];
    PyObject *answer = copied(NPY_CDOUBLE, kept, to);
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

/* Some points of a wall, and which of them are to be believed. */
struct points {
    double *x, *y, *weight;
    npy_bool *valid, *member;
    beam count;
};

struct plane {
    double minus_d, minus_sin, cos;
};

static double off(const struct plane *plane, const struct points *p, beam i) {
    return plane->minus_d + plane->minus_sin * p->x[i] + plane->cos * p->y[i];
}

/* Fit the members by total least squares, then for each gate once more whoever is so near to the fit; see _refined. */
static PyObject *refined(struct points *p, const double *gates_m, int gates) {
    double distance_m = 0.0, heading_rad = 0.0;
    beam members = 0;
    for (int fit = 0; fit <= gates; fit++) {
        double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
        members = 0;
        for (beam i = 0; i < p->count; i++) {
            if (!p->member[i])
                continue;
            members++;
            sx += p->x[i];
            sy += p->y[i];
            sxx += p->x[i] * p->x[i];
            sxy += p->x[i] * p->y[i];
            syy += p->y[i] * p->y[i];
        }
        if (members < WALL_FEWEST_INLIERS)
            Py_RETURN_NONE;
        double n = (double)members, mx = sx / n, my = sy / n;
        heading_rad = 0.5 * atan2(2 * (sxy / n - mx * my), (sxx - syy) / n - mx * mx + my * my);
        double cosine = cos(heading_rad), sine = sin(heading_rad);
        distance_m = cosine * my - sine * mx;
        if (fit == gates)
            break;
        struct plane plane = {-distance_m, -sine, cosine};
        for (beam i = 0; i < p->count; i++)
            p->member[i] = p->valid[i] && fabs(off(&plane, p, i)) < gates_m[fit];
    }
    if (!(distance_m >= 0))
        Py_RETURN_NONE;
    return Py_BuildValue("(ddn)", distance_m, heading_rad, members);
}

/* The plane through one pair of points; false where no wall could be so. */
static int plane_of(const struct points *p, npy_intp rear, npy_intp front, struct plane *plane) {
    if (!p->valid[rear] || !p->valid[front])
        return 0;
    double ahead = p->x[front] - p->x[rear], aside = p->y[front] - p->y[rear];
    double length = hypot(ahead, aside) + 1e-9, cosine = ahead / length, sine = aside / length;
    double distance = cosine * p->y[rear] - sine * p->x[rear];
    *plane = (struct plane){-distance, -sine, cosine};
    return cosine > WALL_STEEPEST_COS && distance > WALL_NEAREST_LINE_M;
}

static int vote(struct points *p, const struct row *rear, const struct row *front) {
    struct plane best = {0, 0, 0}, plane;
    double most_votes = -1.0;
    for (beam k = 0; k < rear->count; k++) {
        if (!plane_of(p, INDEX(*rear, k), INDEX(*front, k), &plane))
            continue;
        double votes = 0.0;
        for (beam i = 0; i < p->count; i++)
            votes += fabs(off(&plane, p, i)) < WALL_GATES_M_0 ? p->weight[i] : 0.0;
        votes /= 1.0 - WALL_NEARER_WINS_PER_M * plane.minus_d;
        if (votes > most_votes) {
            most_votes = votes;
            best = plane;
        }
    }
    for (beam i = 0; i < p->count; i++)
        p->member[i] = p->valid[i] && fabs(off(&best, p, i)) < WALL_GATES_M_0;
    return most_votes >= 0.0;
}

/* Whether the line that was expected has so many votes that no other can have as many. */
static int wins(struct points *p, double distance_m, double heading_rad) {
    double cosine = cos(heading_rad), sine = sin(heading_rad), for_it = 0.0, all = 0.0;
    for (beam i = 0; i < p->count; i++) {
        p->member[i] = p->valid[i] && fabs(cosine * p->y[i] - sine * p->x[i] - distance_m) < WALL_GATES_M_0;
        for_it += p->member[i] ? p->weight[i] : 0.0;
        all += p->weight[i];
    }
    return for_it > WALL_WINS_WITH * all;
}

/* wall_line(x, y, ranges, usable, beams, rear, front, expected_m, expected_rad) -> (distance, heading, inliers) | None;
 * expected_m: NaN where nothing is expected. */
KERNEL(wall_line) {
    struct row x, y, range, usable, beams, rear, front;
    double expected[2];
    if (!enough(count, 9, "wall_line") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_DOUBLE, &range) || !as_row(given[3], NPY_BOOL, &usable) ||
        !as_row(given[4], NPY_INTP, &beams) || !as_row(given[5], NPY_INTP, &rear) ||
        !as_row(given[6], NPY_INTP, &front) || !as_numbers(given + 7, 2, expected))
        return NULL;
    struct points p = {.count = beams.count};
    p.x = malloc((size_t)(p.count + 1) * (3 * sizeof(double) + 2));
    if (!p.x)
        return PyErr_NoMemory();
    p.y = p.x + p.count;
    p.weight = p.y + p.count;
    p.valid = (npy_bool *)(p.weight + p.count);
    p.member = p.valid + p.count;
    beam valid = 0, wrong = rear.count != front.count;
    for (beam i = 0; i < p.count && !wrong; i++) {
        npy_intp from = INDEX(beams, i);
        wrong = from < 0 || from >= x.count || from >= y.count || from >= range.count || from >= usable.count;
        if (wrong)
            break;
        double range_m = NUMBER(range, from);
        p.valid[i] = FLAG(usable, from) && range_m > WALL_NEAREST_M && range_m < WALL_FARTHEST_M;
        p.x[i] = p.valid[i] ? NUMBER(x, from) : 0.0;
        p.y[i] = p.valid[i] ? NUMBER(y, from) : 0.0;
        p.weight[i] = p.valid[i] ? least(range_m, WALL_VOTE_RANGE_M) : 0.0;
        valid += p.valid[i];
    }
    for (beam k = 0; k < rear.count && !wrong; k++)
        wrong = INDEX(rear, k) < 0 || INDEX(rear, k) >= p.count || INDEX(front, k) < 0 || INDEX(front, k) >= p.count;
    PyObject *answer;
    const double gates_m[] = {WALL_GATES_M_1, WALL_GATES_M_2};
    if (wrong)
        answer = PyErr_Format(PyExc_IndexError, "wall_line: indices outside the scan");
    else if (valid < WALL_FEWEST_INLIERS || !rear.count)
        answer = Py_NewRef(Py_None);
    else if (!isnan(expected[0]) && wins(&p, expected[0], expected[1]))
        answer = refined(&p, gates_m + 1, 1);
    else
        answer = vote(&p, &rear, &front) ? refined(&p, gates_m, 2) : Py_NewRef(Py_None);
    free(p.x);
    return answer;
}
