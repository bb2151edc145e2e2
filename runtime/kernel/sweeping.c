/* Twins of runtime/control/footprint.py and strip.py: the strip that the car sweeps, and what stands in it. */

#include "arrays.h"
#include "constants.h"

/* solid_places(x, y, solid) -> places */
KERNEL(solid_places) {
    struct row x, y, solid;
    if (!enough(count, 3, "solid_places") || !as_row(given[0], NPY_DOUBLE, &x) || !as_row(given[1], NPY_DOUBLE, &y) ||
        !as_row(given[2], NPY_BOOL, &solid))
        return NULL;
    if (x.count != solid.count || y.count != solid.count) {
        PyErr_SetString(PyExc_ValueError, "solid_places: arrays of different lengths");
        return NULL;
    }
    beam few = 0;
    for (beam i = 0; i < solid.count; i++)
        few += FLAG(solid, i) != 0;
    PyObject *answer = fresh(NPY_CDOUBLE, few);
    if (!answer)
        return NULL;
    place *to = DATA(place, answer);
    for (beam i = 0; i < solid.count; i++)
        if (FLAG(solid, i))
            *to++ = CMPLX(NUMBER(x, i), NUMBER(y, i));
    return answer;
}

/* any_nearer(solid, ranges, reach) -> bool */
KERNEL(any_nearer) {
    struct row solid, range;
    double reach_m;
    if (!enough(count, 3, "any_nearer") || !as_row(given[0], NPY_BOOL, &solid) ||
        !as_row(given[1], NPY_DOUBLE, &range) || !as_numbers(given + 2, 1, &reach_m))
        return NULL;
    for (beam i = 0; i < solid.count && i < range.count; i++)
        if (FLAG(solid, i) && NUMBER(range, i) < reach_m)
            Py_RETURN_TRUE;
    Py_RETURN_FALSE;
}

/* How the car moves: the arguments of bent_way after the steering, in the order of Motion. */
struct motion {
    double speed, direction, wheel, latency, rate, wheelbase, turning, slip, along, end;
};

static double bent(const struct motion *m, double steering, double travel, int slews) {
    if (!slews)
        return tan(steering) / m->wheelbase;
    double change = steering - m->wheel;
    double turned = travel * (m->rate / most(m->speed, FOOTPRINT_SLEWS_AT_LEAST_MPS));
    turned -= m->latency * m->rate;
    turned = most(least(turned, fabs(change)), 0.0);
    return tan(turned * copysign(1.0, change) + m->wheel) / m->wheelbase;
}

/* The sharpest curvature that the tyres follow at this place. */
static double sharpest(const struct motion *m, double travel) {
    double square = m->speed * m->speed, end = m->end * m->end;
    if (m->along) {
        square += 2 * m->along * travel;
        square = m->along > 0 ? least(square, end) : most(square, most(end, 0.01));
    }
    return m->turning / square;
}

/* bent_way(steps, steering, *motion) -> travel, place, heading, curvature */
KERNEL(bent_way) {
    beam steps;
    double steering;
    struct motion m;
    if (!enough(count, 12, "bent_way") || !as_indices(given, 1, &steps) || !as_numbers(given + 1, 1, &steering) ||
        !as_numbers(given + 2, 10, (double *)&m))
        return NULL;
    if (steps < 0)
        return PyErr_Format(PyExc_ValueError, "bent_way: %zd steps", steps);
    PyObject *travels = fresh(NPY_DOUBLE, steps), *places = fresh(NPY_CDOUBLE, steps);
    PyObject *headings = fresh(NPY_CDOUBLE, steps), *curvatures = fresh(NPY_DOUBLE, steps);
    if (travels && places && headings && curvatures) {
        double step_m = m.direction * FOOTPRINT_STEP_M, square = m.speed * m.speed;
        double tightest = most(fabs(tan(steering)), fabs(tan(m.wheel))) / m.wheelbase;
        int limited = !(most(square, m.end * m.end) * tightest <= m.turning), slews = steering - m.wheel != 0.0;
        double yaw = 0.0;
        place at = 0.0;
        for (beam i = 0; i < steps; i++) {
            double travel = FOOTPRINT_STEP_M * (double)(i + 1), curvature = bent(&m, steering, travel, slews);
            if (limited) {
                double limit = sharpest(&m, travel);
                curvature = least(most(curvature, -limit), limit);
            }
            yaw += curvature;
            double yaw_rad = yaw * step_m, moved_rad = yaw_rad - curvature * (step_m / 2 + square * m.slip);
            at += CMPLX(cos(moved_rad) * step_m, sin(moved_rad) * step_m);
            DATA(double, travels)[i] = travel;
            DATA(place, places)[i] = at;
            DATA(place, headings)[i] = CMPLX(cos(yaw_rad), sin(yaw_rad));
            DATA(double, curvatures)[i] = curvature;
        }
    } else {
        Py_CLEAR(travels);
        Py_CLEAR(places);
        Py_CLEAR(headings);
        Py_CLEAR(curvatures);
        return PyErr_NoMemory();
    }
    return Py_BuildValue("(NNNN)", travels, places, headings, curvatures);
}

_Static_assert(FOOTPRINT_ENOUGH_POINTS == 3, "`touched` keeps the three deepest");

struct outline {
    double front, rear, half;
};

struct box {
    double low_x, high_x, low_y, high_y;
};

/* A box that holds what the outline covers at these poses; see _in_reach of footprint.py. */
static struct box reach(const struct outline *o, const struct row *at, const struct row *heading, beam from, beam to) {
    struct box box = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    double middle = (o->front - o->rear) / 2, half = (o->front + o->rear) / 2, steepest = 0.0;
    for (beam i = from; i < to; i++) {
        place centre = PLACE(*at, i) + middle * PLACE(*heading, i);
        steepest = most(steepest, fabs(cimag(PLACE(*heading, i))));
        box.low_x = least(box.low_x, creal(centre));
        box.high_x = most(box.high_x, creal(centre));
        box.low_y = least(box.low_y, cimag(centre));
        box.high_y = most(box.high_y, cimag(centre));
    }
    double along = half + o->half * steepest, aside = half * steepest + o->half;
    return (struct box){box.low_x - along, box.high_x + along, box.low_y - aside, box.high_y + aside};
}

static beam in_reach(const struct box *box, const place *from, beam points, place *to) {
    beam kept = 0;
    for (beam i = 0; i < points; i++) {
        double x = creal(from[i]), y = cimag(from[i]);
        if (y <= box->high_y && y >= box->low_y && x <= box->high_x && x >= box->low_x)
            to[kept++] = from[i];
    }
    return kept;
}

/* How deep the third-deepest point is, and where aside the innermost; the number of points inside. */
static beam touched(const struct outline *o, place at, place heading, const place *points, beam many, double direction,
                    double *third, double *innermost) {
    double deepest[3] = {-INFINITY, -INFINITY, -INFINITY}, low = INFINITY, high = -INFINITY;
    beam inside = 0;
    for (beam i = 0; i < many; i++) {
        place seen = times(points[i] - at, conj(heading));
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

/* first_touch(travel, place, heading, curvature, points, front, rear, half_width, direction)
 *   -> (travel, aside, curvature) | None */
KERNEL(first_touch) {
    struct row travel, at, heading, curvature, points;
    double v[4];
    if (!enough(count, 9, "first_touch") || !as_row(given[0], NPY_DOUBLE, &travel) ||
        !as_row(given[1], NPY_CDOUBLE, &at) || !as_row(given[2], NPY_CDOUBLE, &heading) ||
        !as_row(given[3], NPY_DOUBLE, &curvature) || !as_row(given[4], NPY_CDOUBLE, &points) ||
        !as_numbers(given + 5, 4, v))
        return NULL;
    beam poses = travel.count, many = points.count;
    if (at.count != poses || heading.count != poses || curvature.count != poses) {
        PyErr_SetString(PyExc_ValueError, "first_touch: a path of different lengths");
        return NULL;
    }
    struct outline o = {v[0], v[1], v[2]};
    place *some = malloc(sizeof(place) * (size_t)(2 * many + 1)), *near = some + many;
    if (!some)
        return PyErr_NoMemory();
    for (beam i = 0; i < many; i++)
        near[i] = PLACE(points, i);
    struct box all = reach(&o, &at, &heading, 0, poses);
    many = in_reach(&all, near, many, some);
    PyObject *answer = NULL;
    const beam at_once = FOOTPRINT_POSES_AT_ONCE;
    for (beam first = 0; first < poses && !answer && many >= FOOTPRINT_ENOUGH_POINTS; first += at_once) {
        beam last = first + at_once < poses ? first + at_once : poses;
        struct box piece = reach(&o, &at, &heading, first, last);
        beam few = in_reach(&piece, some, many, near);
        for (beam i = first; i < last && !answer && few >= FOOTPRINT_ENOUGH_POINTS; i++) {
            double third, aside;
            if (touched(&o, PLACE(at, i), PLACE(heading, i), near, few, v[3], &third, &aside) < FOOTPRINT_ENOUGH_POINTS)
                continue;
            double way = NUMBER(travel, i);
            answer = Py_BuildValue("(ddd)", most(way - FOOTPRINT_STEP_M, way - third), aside, NUMBER(curvature, i));
            if (!answer) {
                free(some);
                return NULL;
            }
        }
    }
    free(some);
    return answer ? answer : Py_NewRef(Py_None);
}
