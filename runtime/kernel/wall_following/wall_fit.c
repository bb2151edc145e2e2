/* Twin of runtime/control/wall_following/wall_fit.py: the wall as one straight line. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

/* Some points of a wall, and which of them are usable. */
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

/* Fit the members by total least squares, then for each gate once more the points within it; see _refined. */
static enum found refined(struct points *p, const double *gates_m, int gates, struct wall_line *line) {
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
        if (members < WALL_FIT_MIN_INLIERS)
            return NONE;
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
    *line = (struct wall_line){distance_m, heading_rad, members};
    return distance_m >= 0 ? FOUND : NONE;
}

/* The plane through one pair of points; false where it cannot be a wall. */
static int plane_of(const struct points *p, npy_intp rear, npy_intp front, struct plane *plane) {
    if (!p->valid[rear] || !p->valid[front])
        return 0;
    double ahead = p->x[front] - p->x[rear], aside = p->y[front] - p->y[rear];
    double length = hypot(ahead, aside) + 1e-9, cosine = ahead / length, sine = aside / length;
    double distance = cosine * p->y[rear] - sine * p->x[rear];
    *plane = (struct plane){-distance, -sine, cosine};
    return cosine > WALL_FIT_MAX_SLOPE_COS && distance > WALL_FIT_MIN_LINE_M;
}

static int vote(struct points *p, const struct row *rear, const struct row *front) {
    struct plane best = {0, 0, 0}, plane;
    double most_votes = -1.0;
    for (beam k = 0; k < rear->count; k++) {
        if (!plane_of(p, INDEX(*rear, k), INDEX(*front, k), &plane))
            continue;
        double votes = 0.0;
        for (beam i = 0; i < p->count; i++)
            votes += fabs(off(&plane, p, i)) < WALL_FIT_GATES_M_0 ? p->weight[i] : 0.0;
        votes /= 1.0 - WALL_FIT_NEARER_WINS_PER_M * plane.minus_d;
        if (votes > most_votes) {
            most_votes = votes;
            best = plane;
        }
    }
    for (beam i = 0; i < p->count; i++)
        p->member[i] = p->valid[i] && fabs(off(&best, p, i)) < WALL_FIT_GATES_M_0;
    return most_votes >= 0.0;
}

/* Whether the line that was expected has so many votes that no other can have as many. */
static int wins(struct points *p, double distance_m, double heading_rad) {
    double cosine = cos(heading_rad), sine = sin(heading_rad), for_it = 0.0, all = 0.0;
    for (beam i = 0; i < p->count; i++) {
        p->member[i] = p->valid[i] && fabs(cosine * p->y[i] - sine * p->x[i] - distance_m) < WALL_FIT_GATES_M_0;
        for_it += p->member[i] ? p->weight[i] : 0.0;
        all += p->weight[i];
    }
    return for_it > WALL_FIT_WINS_WITH * all;
}

enum found find_line(const struct row *x, const struct row *y, const struct row *range, const struct row *usable,
                     const struct row *beams, const struct row *rear, const struct row *front, const double *expected,
                     struct wall_line *line) {
    struct points p = {.count = beams->count};
    p.x = malloc((size_t)(p.count + 1) * (3 * sizeof(double) + 2));
    if (!p.x) {
        PyErr_NoMemory();
        return FAILED;
    }
    p.y = p.x + p.count;
    p.weight = p.y + p.count;
    p.valid = (npy_bool *)(p.weight + p.count);
    p.member = p.valid + p.count;
    beam valid = 0, wrong = rear->count != front->count;
    for (beam i = 0; i < p.count && !wrong; i++) {
        npy_intp from = INDEX(*beams, i);
        wrong = from < 0 || from >= x->count || from >= y->count || from >= range->count || from >= usable->count;
        if (wrong)
            break;
        double range_m = NUMBER(*range, from);
        p.valid[i] = FLAG(*usable, from) && range_m > WALL_FIT_MIN_RANGE_M && range_m < WALL_FIT_MAX_RANGE_M;
        p.x[i] = p.valid[i] ? NUMBER(*x, from) : 0.0;
        p.y[i] = p.valid[i] ? NUMBER(*y, from) : 0.0;
        p.weight[i] = p.valid[i] ? least(range_m, WALL_FIT_VOTE_RANGE_M) : 0.0;
        valid += p.valid[i];
    }
    for (beam k = 0; k < rear->count && !wrong; k++)
        wrong = INDEX(*rear, k) < 0 || INDEX(*rear, k) >= p.count || INDEX(*front, k) < 0 ||
                INDEX(*front, k) >= p.count;
    const double gates_m[] = {WALL_FIT_GATES_M_1, WALL_FIT_GATES_M_2};
    enum found answer = NONE;
    if (wrong) {
        PyErr_SetString(PyExc_IndexError, "wall_line: indices outside the scan");
        answer = FAILED;
    } else if (valid < WALL_FIT_MIN_INLIERS || !rear->count)
        answer = NONE;
    else if (!isnan(expected[0]) && wins(&p, expected[0], expected[1]))
        answer = refined(&p, gates_m + 1, 1, line);
    else if (vote(&p, rear, front))
        answer = refined(&p, gates_m, 2, line);
    free(p.x);
    return answer;
}

/* fit_wall_line(x, y, ranges, usable, beams, rear, front, expected_m, expected_rad) -> (distance, heading, inliers) | None;
 * expected_m: NaN where nothing is expected. */
KERNEL(fit_wall_line) {
    struct row x, y, range, usable, beams, rear, front;
    struct wall_line line;
    double expected[2];
    if (!enough(count, 9, "fit_wall_line") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_DOUBLE, &range) || !as_row(given[3], NPY_BOOL, &usable) ||
        !as_row(given[4], NPY_INTP, &beams) || !as_row(given[5], NPY_INTP, &rear) ||
        !as_row(given[6], NPY_INTP, &front) || !as_numbers(given + 7, 2, expected))
        return NULL;
    enum found found = find_line(&x, &y, &range, &usable, &beams, &rear, &front, expected, &line);
    if (found == FAILED)
        return NULL;
    if (found == NONE)
        Py_RETURN_NONE;
    return Py_BuildValue("(ddn)", line.distance_m, line.heading_rad, line.inliers);
}
