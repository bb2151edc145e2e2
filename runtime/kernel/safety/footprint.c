/* Twin of runtime/control/safety/footprint.py: the swept strip, and the contacts in it. */

#include "arrays.h"
#include "constants.h"

/* As numpy's minimum and maximum: NaN in either argument propagates. */
static inline double lower(double a, double b) { return a < b || isnan(a) ? a : b; }
static inline double higher(double a, double b) { return a > b || isnan(a) ? a : b; }

/* Motion of the car, in the order of PathMotion. */
struct motion {
    double speed, direction, wheel, latency, rate, wheelbase, turning, slip, along, end;
};

/* One pose of the rear axle. */
struct pose {
    place at, heading;
    double travel, curvature;
};

/* The angle of the wheels at this place. */
static double turned(const struct motion *m, double change, double travel) {
    double by = travel * (m->rate / greater(m->speed, FOOTPRINT_MIN_SLEW_SPEED_MPS)) - m->latency * m->rate;
    return higher(lower(by, fabs(change)), 0.0) * copysign(1.0, change) + m->wheel;
}

/* The maximum curvature that the tyres follow at this place. */
static double sharpest(const struct motion *m, double travel) {
    double square = m->speed * m->speed, end = m->end * m->end;
    if (m->along) {
        square += 2 * m->along * travel;
        square = m->along > 0 ? lower(square, end) : higher(square, greater(end, 0.01));
    }
    return m->turning / square;
}

/* The poses of `arc`; fails where Python does. */
static int arc(const struct motion *m, double steering, struct pose *to, beam steps) {
    double step_m = m->direction * FOOTPRINT_STEP_M, square = m->speed * m->speed, change = steering - m->wheel;
    if (isinf(steering) || isinf(m->wheel)) {
        PyErr_SetString(PyExc_ValueError, "math domain error"); /* as Python's tan */
        return 0;
    }
    double tightest = greater(fabs(tan(steering)), fabs(tan(m->wheel))) / m->wheelbase;
    int limited = !(greater(square, m->end * m->end) * tightest <= m->turning);
    if (!m->wheelbase || (limited && !m->along && !square)) {
        PyErr_SetString(PyExc_ZeroDivisionError, "float division by zero");
        return 0;
    }
    double angle = change ? turned(m, change, FOOTPRINT_STEP_M) : steering, bend = tan(angle) / m->wheelbase, yaw = 0.0;
    place at = 0.0;
    for (beam i = 0; i < steps; i++) {
        double travel = FOOTPRINT_STEP_M * (double)(i + 1), now = change ? turned(m, change, travel) : steering;
        if (now != angle) { /* the wheels' angle is constant on most of the path */
            angle = now;
            bend = tan(angle) / m->wheelbase;
        }
        double curvature = bend;
        if (limited) {
            double limit = sharpest(m, travel);
            curvature = lower(higher(curvature, -limit), limit);
        }
        yaw += curvature;
        double yaw_rad = yaw * step_m, moved_rad = yaw_rad - curvature * (step_m / 2 + square * m->slip);
        at += CMPLX(cos(moved_rad) * step_m, sin(moved_rad) * step_m);
        to[i] = (struct pose){at, CMPLX(cos(yaw_rad), sin(yaw_rad)), travel, curvature};
    }
    return 1;
}

_Static_assert(GEOMETRY_ENOUGH_POINTS == 3, "`touched` keeps the three deepest");

struct outline {
    double front, rear, half;
};

struct box {
    double low_x, high_x, low_y, high_y;
};

/* A box that holds what the outline covers at these poses; see _in_reach of footprint.py. */
static struct box reach(const struct outline *o, const struct pose *poses, beam count) {
    struct box box = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    double middle = (o->front - o->rear) / 2, half = (o->front + o->rear) / 2, steepest = 0.0;
    for (beam i = 0; i < count; i++) {
        place centre = poses[i].at + middle * poses[i].heading;
        steepest = higher(steepest, fabs(cimag(poses[i].heading)));
        box.low_x = lower(box.low_x, creal(centre));
        box.high_x = higher(box.high_x, creal(centre));
        box.low_y = lower(box.low_y, cimag(centre));
        box.high_y = higher(box.high_y, cimag(centre));
    }
    double along = half + o->half * steepest, aside = half * steepest + o->half;
    return (struct box){box.low_x - along, box.high_x + along, box.low_y - aside, box.high_y + aside};
}

static beam in_reach(const struct box *box, const struct row *from, place *to) {
    beam kept = 0;
    for (beam i = 0; i < from->count; i++) {
        place point = PLACE(*from, i);
        double x = creal(point), y = cimag(point);
        if (y <= box->high_y && y >= box->low_y && x <= box->high_x && x >= box->low_x)
            to[kept++] = point;
    }
    return kept;
}

/* Depth of the third-deepest point, and lateral place of the innermost; the number of points inside. */
static beam touched(const struct outline *o, const struct pose *pose, const place *points, beam many, double direction,
                    double *third, double *innermost) {
    double deepest[3] = {-INFINITY, -INFINITY, -INFINITY}, low = INFINITY, high = -INFINITY;
    beam inside = 0;
    for (beam i = 0; i < many; i++) {
        place seen = times(points[i] - pose->at, conj(pose->heading));
        double ahead = creal(seen), aside = cimag(seen);
        if (!(fabs(aside) <= o->half && ahead <= o->front && ahead >= -o->rear))
            continue;
        double depth = direction > 0 ? o->front - ahead : o->rear + ahead;
        inside++;
        for (int k = 0; k < 3; k++)
            if (depth > deepest[k]) {
                double other = deepest[k];
                deepest[k] = depth;
                depth = other;
            }
        low = least(low, aside);
        high = most(high, aside);
    }
    *third = deepest[2];
    *innermost = low > 0 ? low : high < 0 ? high : 0.0;
    return inside;
}

/* The first contact on these poses; some and near: room for every point. */
static PyObject *first_touch(const struct outline *o, const struct pose *poses, beam steps, const struct row *points,
                             double direction, place *some, place *near) {
    struct box all = reach(o, poses, steps);
    struct row row = {(char *)some, sizeof(place), in_reach(&all, points, some)};
    const beam at_once = FOOTPRINT_POSES_AT_ONCE;
    for (beam first = 0; first < steps && row.count >= GEOMETRY_ENOUGH_POINTS; first += at_once) {
        beam last = steps - first < at_once ? steps : first + at_once;
        struct box piece = reach(o, poses + first, last - first);
        beam few = in_reach(&piece, &row, near);
        for (beam i = first; i < last && few >= GEOMETRY_ENOUGH_POINTS; i++) {
            double third, aside, way = poses[i].travel;
            if (touched(o, poses + i, near, few, direction, &third, &aside) >= GEOMETRY_ENOUGH_POINTS)
                return Py_BuildValue("(ddd)", greater(way - FOOTPRINT_STEP_M, way - third), aside, poses[i].curvature);
        }
    }
    return Py_NewRef(Py_None);
}

/* sweep_arc(steering, length, points, front, rear, half_width, *motion) -> (travel, aside, curvature) | None */
KERNEL(sweep_arc) {
    double way[2];
    struct row points;
    struct outline o;
    struct motion m;
    if (!enough(count, 16, "sweep_arc") || !as_numbers(given, 2, way) || !as_row(given[2], NPY_CDOUBLE, &points) ||
        !as_numbers(given + 3, 3, (double *)&o) || !as_numbers(given + 6, 10, (double *)&m))
        return NULL;
    double steps = ceil(way[1] / FOOTPRINT_STEP_M);
    if (!isfinite(steps))
        return PyLong_FromDouble(steps); /* fails as ceil does */
    steps = most(steps, 1.0);
    const beam many = points.count, most_steps = PY_SSIZE_T_MAX / (beam)sizeof(struct pose) - many;
    _Static_assert(sizeof(struct pose) >= 2 * sizeof(place), "the room of a pose is enough for a point, twice");
    struct pose *poses = steps < (double)most_steps ? malloc(sizeof *poses * (size_t)((beam)steps + many)) : NULL;
    if (!poses)
        return PyErr_NoMemory();
    place *some = (place *)(poses + (beam)steps);
    PyObject *answer = NULL;
    if (arc(&m, way[0], poses, (beam)steps))
        answer = first_touch(&o, poses, (beam)steps, &points, m.direction, some, some + many);
    free(poses);
    return answer;
}

/* sweep_path(travel, place, heading, curvature, points, front, rear, half_width, direction) -> as sweep_arc */
KERNEL(sweep_path) {
    struct row travel, at, heading, curvature, points;
    struct outline o;
    double direction;
    if (!enough(count, 9, "sweep_path") || !as_row(given[0], NPY_DOUBLE, &travel) || !as_row(given[1], NPY_CDOUBLE, &at) ||
        !as_row(given[2], NPY_CDOUBLE, &heading) || !as_row(given[3], NPY_DOUBLE, &curvature) ||
        !as_row(given[4], NPY_CDOUBLE, &points) || !as_numbers(given + 5, 3, (double *)&o) ||
        !as_numbers(given + 8, 1, &direction))
        return NULL;
    const beam steps = travel.count, many = points.count;
    if (!steps || at.count != steps || heading.count != steps || curvature.count != steps)
        return PyErr_Format(PyExc_ValueError, "sweep_path: no poses, or arrays of different lengths");
    struct pose *poses = malloc(sizeof *poses * (size_t)(steps + many + 1));
    if (!poses)
        return PyErr_NoMemory();
    for (beam i = 0; i < steps; i++)
        poses[i] = (struct pose){PLACE(at, i), PLACE(heading, i), NUMBER(travel, i), NUMBER(curvature, i)};
    place *some = (place *)(poses + steps);
    PyObject *answer = first_touch(&o, poses, steps, &points, direction, some, some + many);
    free(poses);
    return answer;
}

/* slide_room_m(places, course, points, front, half_width) -> ways ahead */
KERNEL(slide_room_m) {
    struct row places, course, points;
    double v[2];
    if (!enough(count, 5, "slide_room_m") || !as_row(given[0], NPY_CDOUBLE, &places) ||
        !as_row(given[1], NPY_CDOUBLE, &course) || !as_row(given[2], NPY_CDOUBLE, &points) || !as_numbers(given + 3, 2, v))
        return NULL;
    if (course.count != places.count || points.count < GEOMETRY_ENOUGH_POINTS)
        return PyErr_Format(PyExc_ValueError, "slide_room_m: arrays of different lengths, or fewer than three points");
    PyObject *answer = fresh(NPY_DOUBLE, places.count);
    for (beam i = 0; answer && i < places.count; i++) {
        double nearest[3] = {INFINITY, INFINITY, INFINITY};
        for (beam k = 0; k < points.count; k++) {
            place seen = times(PLACE(points, k) - PLACE(places, i), conj(PLACE(course, i)));
            double ahead = creal(seen) - v[0];
            if (!(fabs(cimag(seen)) <= v[1] && ahead > -FOOTPRINT_NOSE_STEP_M))
                continue;
            for (int j = 0; j < 3; j++)
                if (ahead < nearest[j]) {
                    double other = nearest[j];
                    nearest[j] = ahead;
                    ahead = other;
                }
        }
        DATA(double, answer)[i] = nearest[2];
    }
    return answer;
}
