/* Twins of runtime/control/ball_path.py: the path of a ball that is rolled along the wall. */

#include "arrays.h"
#include "constants.h"

#define TAU 6.283185307179586476925286766559

/* The bearing on a circle that is nearest to the wall, where the wall does not meet the circle. */
static double nearest_rad(const double *range, const double *bearing, beam points, double radius) {
    double best = INFINITY, at = 0.0;
    for (beam i = 0; i < points; i++) {
        double aim = least(most(bearing[i], -BALL_PATH_WIDEST_RAD), BALL_PATH_WIDEST_RAD);
        double apart2 = range[i] * range[i] - 2.0 * (radius * (range[i] * cos(bearing[i] - aim)));
        if (apart2 < best) {
            best = apart2;
            at = aim;
        }
    }
    return at;
}

/* rolled(ranges, bearings, ball_m, radii) -> ((bearing, ...), (meets, ...), (crosses, ...)) */
KERNEL(rolled) {
    struct row ranges, bearings;
    double ball_m, radius[32];
    if (!enough(count, 4, "rolled") || !as_row(given[0], NPY_DOUBLE, &ranges) ||
        !as_row(given[1], NPY_DOUBLE, &bearings) || !as_numbers(given + 2, 1, &ball_m))
        return NULL;
    if (!PyTuple_Check(given[3]) || PyTuple_GET_SIZE(given[3]) > 32 || bearings.count != ranges.count) {
        PyErr_SetString(PyExc_TypeError, "rolled wants as many bearings as ranges, and at most 32 radii in a tuple");
        return NULL;
    }
    int circles = (int)PyTuple_GET_SIZE(given[3]);
    beam points = ranges.count;
    for (int k = 0; k < circles; k++) {
        PyObject *one = PyTuple_GET_ITEM(given[3], k);
        if (!as_numbers(&one, 1, radius + k))
            return NULL;
    }
    double *range = malloc(sizeof(double) * (size_t)(5 * points + 1));
    if (!range)
        return PyErr_NoMemory();
    double *bearing = range + points, *free_side = bearing + points, *over = free_side + points, *under = over + points;
    for (beam i = 0; i < points; i++) {
        range[i] = NUMBER(ranges, i);
        bearing[i] = NUMBER(bearings, i);
        free_side[i] = fmod(bearing[i] + BALL_PATH_WIDEST_RAD, TAU);
        if (free_side[i] < 0)
            free_side[i] += TAU;
        over[i] = 0.5 / range[i];
        under[i] = 0.5 * range[i] - (ball_m * ball_m) * over[i];
    }
    PyObject *answer = Py_BuildValue("(NNN)", PyTuple_New(circles), PyTuple_New(circles), PyTuple_New(circles));
    for (int k = 0; k < circles && answer; k++) {
        double first = INFINITY, last = -INFINITY;
        for (beam i = 0; i < points; i++) {
            double cosine = radius[k] * over[i] + (1.0 / radius[k]) * under[i];
            if (cosine > 1.0) { /* no place of the circle is near this point */
                last = most(last, free_side[i]);
                continue;
            }
            double half = acos(most(cosine, -1.0));
            last = most(last, free_side[i] + half);
            first = least(first, free_side[i] - half);
        }
        int at_once = last > TAU || first < 0.0, crosses = !at_once && first <= 2 * BALL_PATH_WIDEST_RAD;
        double where = (crosses ? first : 0.0) - BALL_PATH_WIDEST_RAD;
        if (!at_once && !crosses)
            where = nearest_rad(range, bearing, points, radius[k]);
        PyObject *number = PyFloat_FromDouble(where);
        if (!number)
            Py_CLEAR(answer);
        else {
            PyTuple_SET_ITEM(PyTuple_GET_ITEM(answer, 0), k, number);
            PyTuple_SET_ITEM(PyTuple_GET_ITEM(answer, 1), k, PyBool_FromLong(at_once || crosses));
            PyTuple_SET_ITEM(PyTuple_GET_ITEM(answer, 2), k, PyBool_FromLong(crosses));
        }
    }
    free(range);
    return answer;
}
