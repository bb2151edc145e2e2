/* Twin of runtime/control/wall_following/ball_path.py: the path of a ball that is rolled along the wall. */

#include "arrays.h"
#include "constants.h"
#include "steps.h"

#define TAU 6.283185307179586476925286766559
#define QUARTER (TAU / 4)
#define BEND_FROM ((int)BALL_PATH_BEND_CIRCLES_0)
#define BEND_TO ((int)BALL_PATH_BEND_CIRCLES_1)

/* The bearing on a circle that is nearest to the wall, where the wall does not meet the circle. */
static double nearest_rad(const double *range, const double *bearing, beam points, double radius) {
    double best = INFINITY, at = 0.0;
    for (beam i = 0; i < points; i++) {
        double aim = bounded(bearing[i], -BALL_PATH_MAX_ANGLE_RAD, BALL_PATH_MAX_ANGLE_RAD);
        double apart2 = range[i] * range[i] - 2.0 * (radius * (range[i] * cos(bearing[i] - aim)));
        if (apart2 < best || (isnan(apart2) && !isnan(best))) { /* as numpy's argmin */
            best = apart2;
            at = aim;
        }
    }
    return at;
}

/* A path over some circles. */
struct path {
    int circles;
    double radius[MAX_NUMBERS], bearing[MAX_NUMBERS];
    npy_bool meets[MAX_NUMBERS], crosses[MAX_NUMBERS];
};

/* A wall's points around the rear axle. */
struct wall {
    beam points;
    double *range, *bearing, *free_side, *over, *under; /* of one allocation */
    double nearest;
};

/* The wall seen from (v[0], v[1]) at heading v[2]; see around. */
static int see(struct wall *wall, const place *places, beam points, const double *v) {
    wall->range = malloc(sizeof(double) * (size_t)(5 * points + 1));
    if (!wall->range) {
        PyErr_NoMemory();
        return 0;
    }
    wall->points = points;
    wall->bearing = wall->range + points;
    wall->free_side = wall->bearing + points;
    wall->over = wall->free_side + points;
    wall->under = wall->over + points;
    wall->nearest = INFINITY;
    place turned = CMPLX(cos(-v[2]), sin(-v[2]));
    for (beam i = 0; i < points; i++) {
        place seen = times(places[i] - CMPLX(v[0], v[1]), turned);
        double range = wall->range[i] = greater(cabs(seen), FOLLOWED_WALL_MIN_RANGE_M);
        wall->nearest = range < wall->nearest || isnan(range) ? range : wall->nearest; /* as numpy's min */
        wall->bearing[i] = atan2(cimag(seen), creal(seen));
    }
    return 1;
}

/* As numpy's max: NaN is larger than any number. */
static double larger(double so_far, double next) { return next > so_far || isnan(next) ? next : so_far; }

/* Roll the ball; see circles_met. */
static void roll(struct wall *wall, double ball, struct path *path) {
    for (beam i = 0; i < wall->points; i++) {
        wall->free_side[i] = fmod(wall->bearing[i] + BALL_PATH_MAX_ANGLE_RAD, TAU);
        if (wall->free_side[i] < 0)
            wall->free_side[i] += TAU;
        wall->over[i] = 0.5 / wall->range[i];
        wall->under[i] = 0.5 * wall->range[i] - (ball * ball) * wall->over[i];
    }
    for (int k = 0; k < path->circles; k++) {
        double first = INFINITY, last = -INFINITY, per_radius = 1.0 / path->radius[k];
        for (beam i = wall->points - 1; i >= 0; i--) { /* from the front: there the path is met first */
            double cosine = path->radius[k] * wall->over[i] + per_radius * wall->under[i], free = wall->free_side[i];
            /* Most points change nothing, whatever the arc cosine: no place of the circle is near them, or at most a
             * quarter of it, and all that farther than what is known. */
            if (cosine > 1.0 || (cosine >= 0.0 && free - QUARTER >= first && free + QUARTER <= TAU))
                continue;
            double half = acos(greater(cosine, -1.0));
            last = larger(last, free + half);
            first = -larger(-first, half - free);
        }
        int at_once = last > TAU || first < 0.0, crosses = !at_once && first <= 2 * BALL_PATH_MAX_ANGLE_RAD;
        path->meets[k] = (npy_bool)(at_once || crosses);
        path->crosses[k] = (npy_bool)crosses;
        path->bearing[k] = path->meets[k] ? (crosses ? first : 0.0) - BALL_PATH_MAX_ANGLE_RAD
                                          : nearest_rad(wall->range, wall->bearing, wall->points, path->radius[k]);
    }
}

/* The roughness of the wall beyond its line; see roughness_m. */
static double roughness(double bias, double noise) {
    return bounded(bias - NOISE_BIAS_BIAS_OF_NOISE * noise * sqrt(noise), 0.0, NOISE_BIAS_MAX_ROUGHNESS_M);
}

/* The bias after one more scan; see noise_bias.py. */
static double learnt(double bias, double found) {
    int possible = NOISE_BIAS_MIN_BIAS_M < found && found < NOISE_BIAS_MAX_BIAS_M;
    return possible ? bias + NOISE_BIAS_LOW_PASS * (found - bias) : bias;
}

/* Distance of the path to the points of the beams after `from`; see apart_m. v: from_x, from_y, yaw of the path. */
static double opposite(const struct path *path, const struct row *x, const struct row *y, const struct row *solid,
                       beam from, const double *v) {
    place there[MAX_NUMBERS], turned = CMPLX(cos(v[2]), sin(v[2]));
    int crossed = 0, all = path->circles < (int)SPEED_PROFILE_CIRCLES ? path->circles : (int)SPEED_PROFILE_CIRCLES;
    for (int k = 0; k < all; k++)
        if (path->crosses[k])
            there[crossed++] = times(CMPLX(path->radius[k] * cos(path->bearing[k]), path->radius[k] * sin(path->bearing[k])),
                                     turned) + CMPLX(v[0], v[1]);
    double nearest = INFINITY;
    for (beam i = from; i < x->count; i += BALL_PATH_OPPOSITE_EVERY) {
        if (!FLAG(*solid, i))
            continue;
        for (int k = 0; k < crossed; k++) {
            double dx = creal(there[k]) - NUMBER(*x, i), dy = cimag(there[k]) - NUMBER(*y, i), apart = dx * dx + dy * dy;
            nearest = apart < nearest || isnan(apart) ? apart : nearest; /* as numpy's min */
        }
    }
    return sqrt(nearest);
}

/* The curvature of a path over four circles. */
static double bend_of(const double *radius, const double *bearing) {
    double x[4], y[4];
    for (int i = 0; i < 4; i++) {
        x[i] = radius[i] * cos(bearing[i]);
        y[i] = radius[i] * sin(bearing[i]);
    }
    double turn = atan2(y[3] - y[2], x[3] - x[2]) - atan2(y[1] - y[0], x[1] - x[0]);
    double way = (hypot(x[2] - x[0], y[2] - y[0]) + hypot(x[3] - x[1], y[3] - y[1])) / 2;
    return remainder(turn, 2 * Py_MATH_PI) / most(way, 1e-3);
}

/* nearest, bias, bend, opposite, (bearing, ...), (meets, ...), (crosses, ...) */
static PyObject *answer_of(const struct path *path, double nearest, double bias, double bend, double opposite) {
    PyObject *parts[3] = {NULL, NULL, NULL};
    for (int part = 0; part < 3; part++)
        parts[part] = PyTuple_New(path->circles);
    for (int k = 0; k < path->circles && parts[0] && parts[1] && parts[2]; k++) {
        PyObject *number = PyFloat_FromDouble(path->bearing[k]);
        if (!number)
            break;
        PyTuple_SET_ITEM(parts[0], k, number);
        PyTuple_SET_ITEM(parts[1], k, PyBool_FromLong(path->meets[k]));
        PyTuple_SET_ITEM(parts[2], k, PyBool_FromLong(path->crosses[k]));
    }
    if (!PyErr_Occurred())
        return Py_BuildValue("(ddddNNN)", nearest, bias, bend, opposite, parts[0], parts[1], parts[2]);
    for (int part = 0; part < 3; part++)
        Py_XDECREF(parts[part]);
    return NULL;
}

/* roll_ball(x, y, solid, indices, more places | None, from_x, from_y, yaw, line_m, line_rad, bias_m, noise_m, desired_m,
 * radii) -> nearest, bias, bend, opposite, (bearing, ...), (meets, ...), (crosses, ...) */
KERNEL(roll_ball) {
    struct row x, y, solid, beams, glass = {NULL, 0, 0};
    struct path path;
    struct wall wall;
    place *places;
    double v[8];
    if (!enough(count, 14, "roll_ball") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid) || !as_row(given[3], NPY_INTP, &beams) ||
        (given[4] != Py_None && !as_row(given[4], NPY_CDOUBLE, &glass)) || !as_numbers(given + 5, 8, v))
        return NULL;
    if (x.count != y.count || x.count != solid.count)
        return PyErr_Format(PyExc_ValueError, "rolled_along: arrays of different lengths");
    path.circles = numbers_of(given[13], path.radius);
    if (path.circles < 0)
        return NULL;
    if (path.circles < BEND_TO || !beams.count)
        return PyErr_Format(PyExc_ValueError, "rolled_along wants a wall, and at least %d circles", BEND_TO);
    beam points = outline_of(&x, &y, &beams, glass.count, &places);
    if (points < 0)
        return NULL;
    for (beam i = 0; i < glass.count; i++)
        places[points++] = PLACE(glass, i);
    int seen = see(&wall, places, points, v);
    free(places);
    if (!seen)
        return NULL;
    double line = v[3] - (cos(v[4]) * v[1] - sin(v[4]) * v[0]), bias = learnt(v[5], line - wall.nearest);
    roll(&wall, v[7] - bias + roughness(bias, v[6]), &path);
    free(wall.range);
    int whole = 1;
    for (int k = BEND_FROM; k < BEND_TO; k++)
        whole = whole && path.meets[k];
    double bend = whole ? bend_of(path.radius + BEND_FROM, path.bearing + BEND_FROM) : 0.0;
    double apart = opposite(&path, &x, &y, &solid, INDEX(beams, beams.count - 1) + 1, v);
    return answer_of(&path, wall.nearest, bias, bend, apart);
}
